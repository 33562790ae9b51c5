"""The pairwise laws of thesis chapters 3 to 5: forces compared with NumPy, and documented properties."""

import bond_oracle as oracle
import numpy as np
import pytest
from bond_meshes import FACES, MESHES, TETS
from hypothesis import given, settings
from hypothesis import strategies as st

from taichi_soft import LAWS, Material, ParticleMesh, SpringMaterial, TetMesh, internal_forces
from taichi_soft.core.errors import MaterialError, MeshError, OptionError
from taichi_soft.elements.laws import BondLaw

pytestmark = pytest.mark.kernel

BONDS = [law.name for law in LAWS.values() if isinstance(law, BondLaw)]
DIRECTIONAL = [name for name in BONDS if LAWS[name].takes_shear]


def expected_forces(law, name, x, E, nu, G):
    mesh, faces = MESHES[name], FACES[name]

    def on_first(p, q):
        if law == "springs":
            return oracle.spring(mesh, p, q, x, E, nu)
        if law == "volume_springs":
            return oracle.volume_spring(mesh, p, q, x, E, nu)
        return oracle.bond(law, mesh, p, q, x, E, G, faces[p, q])

    return oracle.summed(mesh, on_first)


@pytest.mark.parametrize("law", BONDS)
@settings(max_examples=4)
@given(
    seed=st.integers(0, 2**32 - 1),
    name=st.sampled_from(list(MESHES)),
    amount=st.sampled_from([0.02, 0.1, 0.25]),
)
def test_forces_equal_the_equations_in_numpy(law, seed, name, amount):
    """The body has many materials, is deformed at random and rotated.

    The tolerance is 1e-10 of the largest force.
    """
    mesh = MESHES[name]
    rng = np.random.default_rng(seed)
    count = len(mesh.tets)
    E, nu, G = rng.uniform(1e5, 1e6, count), rng.uniform(-0.3, 0.45, count), rng.uniform(1e4, 1e6, count)
    shear = {"shear_modulus": G} if law in DIRECTIONAL else {}
    bend = np.eye(3) + amount * rng.normal(size=(3, 3))
    x = mesh.vertices @ bend.T + 0.2 * amount * rng.normal(size=mesh.vertices.shape)
    found = internal_forces(mesh, Material(E, nu, 1000.0, **shear), x, law=law)
    expected = expected_forces(law, name, x, E, nu, G)
    np.testing.assert_allclose(found, expected, atol=1e-10 * np.abs(expected).max(), rtol=0)


@pytest.mark.parametrize("law", BONDS)
@settings(max_examples=3)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_body_at_rest_or_moved_as_a_whole_feels_nothing(law, seed):
    mesh = MESHES["ball"]
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    material = Material(1e6, 0.3, 1000.0)
    for x in (mesh.vertices, mesh.vertices @ turn.T + rng.normal(size=3)):
        assert np.abs(internal_forces(mesh, material, x, law=law)).max() < 1e-9 * 1e6


@pytest.mark.parametrize("law", BONDS)
def test_forces_sum_to_zero_and_torques_where_they_act_along_the_edges(law):
    """Springs act along the line between two particles, so they exert no torque.

    CMPM and its variants also act perpendicular to this line, so a sheared body feels a torque. The limit for
    this torque is 1/50 of the largest force times an edge. For a split ring it is 1/10, because the ring
    begins at one of its particles and is therefore uneven even in this regular body.
    """
    mesh = MESHES["ball"]
    rng = np.random.default_rng(3)
    material = Material(1e6, 0.3, 1000.0)
    torques = []
    for amount in (0.01, 0.1):
        x = mesh.vertices @ (np.eye(3) + amount * np.array([[0, 1, 0], [0, 0, 0], [0, 0, 0]])).T
        x = x + 0.1 * amount * rng.normal(size=x.shape)
        forces = internal_forces(mesh, material, x, law=law)
        largest = np.abs(forces).max()
        assert np.abs(forces.sum(axis=0)).max() < 1e-11 * largest * len(x)
        torques.append(np.abs(np.cross(x, forces).sum(axis=0)).max() / largest / mesh.edge_lengths.mean())
    if law in DIRECTIONAL:
        # The torque of a pair is its shear force times its length. Over all directions, most of it cancels.
        is_even = law != "split_ring_plane"
        assert all(1e-5 < torque < (0.02 if is_even else 0.1) for torque in torques)
        assert torques[1] > (2 if is_even else 1) * torques[0]
    else:
        assert max(torques) < 1e-9


@pytest.mark.parametrize("law", BONDS)
@pytest.mark.parametrize("name", ["ring", "ball"])
def test_damping_equals_the_equations_in_numpy(law, name):
    """Eq. 3.9 along springs; eq. 4.5 along n and m in the others."""
    mesh, faces = MESHES[name], FACES[name]
    rng = np.random.default_rng(6)
    x = mesh.vertices @ (np.eye(3) + 0.1 * rng.normal(size=(3, 3))).T
    v = rng.normal(size=x.shape)
    across = {"shear_damping": 3.0} if law in DIRECTIONAL else {}
    material = Material(1e3, 0.3, 1000.0, 7.0, **across)
    found = internal_forces(mesh, material, x, v, law=law) - internal_forces(mesh, material, x, law=law)

    def on_first(p, q):
        dv = v[q] - v[p]
        if law not in DIRECTIONAL:
            n = oracle.unit(x[q] - x[p])
            return 7.0 * (n @ dv) * n
        frame = oracle.frame(law, mesh, p, q, x, faces[p, q])
        return np.zeros(3) if frame is None else oracle.braked(frame[0], frame[1], dv, 7.0, 3.0)

    expected = oracle.summed(mesh, on_first)
    np.testing.assert_allclose(found, expected, atol=1e-10 * np.abs(expected).max(), rtol=0)
    assert np.sum(expected * v) < 0


def test_a_tilted_plane_follows_all_of_a_shear_and_the_printed_one_an_eighth():
    """Four particles evenly round an edge along z: a shear of z by 0.001 x."""
    points = np.array([[0, 0, -1.0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
    mesh = TetMesh(points, TETS)
    alpha = 1e-3
    x = points.copy()
    x[:, 2] += alpha * points[:, 0]
    for law, part in (("tilted_plane", 1.0), ("tilted_plane_printed", 1 / 8)):
        material = Material(1e6, 0.0, 1000.0, shear_modulus=1e6)
        area = oracle.edge_area(mesh, 0, 1)
        # The edge keeps its direction; m = r - (n.r) n is then part * alpha * l long, against x.
        others = internal_forces(mesh, material, x, law=law)
        force = others[1][0] - sum(
            -oracle.bond(law, mesh, i, 1, x, np.full(4, 1e6), np.full(4, 1e6), None)[0] for i in range(2, 6)
        )
        assert abs(force) == pytest.approx(part * alpha * 1e6 * area, rel=1e-3)


def test_a_grown_tetrahedron_is_pulled_together_by_its_volume():
    """With eq. 5.5 as printed it would be pushed further apart."""
    mesh = TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]], [[0, 1, 2, 3]])
    center = mesh.vertices.mean(axis=0)
    x = center + 1.1 * (mesh.vertices - center)
    plain = internal_forces(mesh, Material(1e6, 0.0, 1000.0), x, law="volume_springs")
    firm = internal_forces(mesh, Material(1e6, 0.4, 1000.0), x, law="volume_springs")
    inward = center - x
    assert (np.einsum("na,na->n", firm - plain, inward) > 0).all()


def test_eq_5_5_as_printed_is_the_law_with_poissons_ratio_turned_round():
    """f_p = -E a nu dV / V0 n beside the springs of eq. 5.2, written out."""
    mesh, nu = MESHES["ring"], 0.3
    x = mesh.vertices + 0.1 * np.random.default_rng(4).normal(size=mesh.vertices.shape)
    E, none = np.full(len(mesh.tets), 1e6), np.zeros(len(mesh.tets))

    def printed(p, q):
        pull = oracle.spring(mesh, p, q, x, E, none)
        for t, _, _ in oracle.tets_round(mesh, p, q):
            before, now = (abs(oracle.signed_volume(y[mesh.tets[t]])) for y in (mesh.vertices, x))
            pull = pull - E[t] * oracle.edge_area(mesh, p, q) * nu * (now / before - 1) * oracle.unit(
                x[q] - x[p]
            )
        return pull

    expected = oracle.summed(mesh, printed)
    found = internal_forces(mesh, Material(1e6, -nu, 1000.0), x, law="volume_springs")
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


def test_constants_per_edge_belong_to_the_edges_as_they_were_given():
    """The edges are in random order. The reference is each edge alone."""
    rng = np.random.default_rng(9)
    points = rng.normal(size=(6, 3))
    pairs = np.array([(p, q) for p in range(6) for q in range(6) if p < q])[rng.permutation(15)]
    pairs[::2] = pairs[::2, ::-1]
    k, length = rng.uniform(1, 9, 15), rng.uniform(0.5, 2, 15)
    mesh = ParticleMesh(points, pairs, 1.0)
    found = internal_forces(mesh, SpringMaterial(k, 0.0, length), points, law="springs")
    expected = np.zeros_like(points)
    for e, (p, q) in enumerate(pairs):
        r = points[q] - points[p]
        force = k[e] * (np.linalg.norm(r) - length[e]) * oracle.unit(r)
        expected[p] += force
        expected[q] -= force
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


class TestGivenSprings:
    MESH = ParticleMesh([[0, 0, 0], [3, 4, 0], [0, 4, 0.0]], [[0, 1], [1, 2]], 1.0)

    def test_each_spring_has_its_own_constants(self):
        material = SpringMaterial([10.0, 20.0], [1.0, 2.0], [4.0, 3.0])
        v = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 0.0]])
        found = internal_forces(self.MESH, material, self.MESH.vertices, v, law="springs")
        n = np.array([0.6, 0.8, 0.0])
        first = (10.0 * (5 - 4) + 1.0 * 0.6) * n
        second = np.array([20.0 * (3 - 3) + 2.0 * 1.0, 0, 0])  # from vertex 1 towards 2 it is -x
        np.testing.assert_allclose(found[0], first, atol=1e-12)
        np.testing.assert_allclose(found[1], -first - second, atol=1e-12)
        np.testing.assert_allclose(found[2], second, atol=1e-12)

    def test_a_bar_of_springs_is_as_stiff_as_its_cross_section(self):
        material = SpringMaterial.from_young(2e6, 0.01, self.MESH.edge_lengths)
        assert material.stiffness.tolist() == [2e6 * 0.01 / 5, 2e6 * 0.01 / 3]
        each = SpringMaterial.from_young(2e6, [0.01, 0.02], self.MESH.edge_lengths)
        assert each.stiffness.tolist() == [2e6 * 0.01 / 5, 2e6 * 0.02 / 3]
        with pytest.raises(MaterialError, match=r"area.*3.*lengths.*2.*one per edge"):
            SpringMaterial.from_young(2e6, [0.01, 0.02, 0.03], self.MESH.edge_lengths)

    def test_a_spring_of_no_length_left_has_no_force(self):
        x = self.MESH.vertices.copy()
        x[1] = x[0]
        forces = internal_forces(self.MESH, SpringMaterial(10.0), x, law="springs")
        assert np.isfinite(forces).all()
        assert forces[0].tolist() == [0, 0, 0]

    @pytest.mark.parametrize(
        ("arguments", "text"),
        [
            ({"stiffness": 0.0}, "stiffness is 0 N/m for every edge"),
            ({"stiffness": [0.0, 0.0]}, "stiffness is 0 N/m for every edge"),
            ({"stiffness": [1.0, 1e-12]}, "stiffness of edge 1 is 1e-12.*from 1e-09"),
            ({"stiffness": [1.0, -2.0]}, "stiffness of edge 1 is -2"),
            ({"stiffness": 1.0, "damping": -1}, "damping is -1"),
            ({"stiffness": 1.0, "rest_length": 0}, "rest_length is 0"),
            ({"stiffness": "soft"}, "stiffness.*one number per edge"),
            ({"stiffness": 1.0, "rest_length": np.nan}, "rest_length is nan"),
            ({"stiffness": [1.0, 2.0], "damping": [1.0, 2.0, 3.0]}, "arrays of different lengths"),
        ],
    )
    def test_constants_out_of_range_are_refused(self, arguments, text):
        with pytest.raises(MaterialError, match=text):
            SpringMaterial(**arguments)

    def test_what_does_not_fit_together_is_refused(self):
        solid, springs = MESHES["ball"], SpringMaterial(10.0)
        x = self.MESH.vertices
        with pytest.raises(MaterialError, match=r"stiffness.*3 values.*2 edges"):
            internal_forces(self.MESH, SpringMaterial([1.0, 2, 3]), x, law="springs")
        with pytest.raises(MeshError, match=r"'virial'.* TetMesh"):
            internal_forces(self.MESH, springs, x)
        with pytest.raises(MeshError, match=r"'springs'.*SpringMaterial"):
            internal_forces(self.MESH, Material(1e6, 0.3, 1000.0), x, law="springs")
        with pytest.raises(MaterialError, match=r"'cmpm'.*Material.*SpringMaterial"):
            internal_forces(solid, springs, solid.vertices, law="cmpm")
        with pytest.raises(MaterialError, match=r"no density.*ParticleMesh"):
            internal_forces(solid, springs, solid.vertices, law="springs")


def test_shear_constants_are_refused_by_laws_without_them():
    mesh = MESHES["ball"]
    for law in ("virial", "springs", "neo_hookean"):
        with pytest.raises(MaterialError, match=f"law '{law}' has no shear_modulus.*leave"):
            internal_forces(mesh, Material(1e6, 0.3, 1e3, shear_modulus=1e5), mesh.vertices, law=law)


@pytest.mark.parametrize(
    ("option", "value"), [("strain", "linear"), ("flips", "recover"), ("damping_model", "tet_mean")]
)
def test_options_of_tetrahedral_laws_are_refused(option, value):
    with pytest.raises(OptionError, match=f"'springs'.*{option}='{value}'.*(leave|use)"):
        internal_forces(
            MESHES["ball"], Material(1e6, 0.3, 1e3), MESHES["ball"].vertices, law="springs", **{option: value}
        )


def test_cmpm_refuses_a_mesh_that_is_not_delaunay():
    flat = TetMesh([[0, 0, 0], [4, 0, 0], [2, 3, 0], [2, 1, 0.4], [2, 1, -0.4]], [[0, 1, 2, 3], [0, 2, 1, 4]])
    with pytest.raises(MeshError, match=r"vertex . .*delaunay_mesh"):
        internal_forces(flat, Material(1e6, 0.3, 1e3), flat.vertices, law="cmpm")
