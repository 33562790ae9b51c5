"""Laws with an energy: forces are its derivative, and a closed path does no work."""

import force_oracle as oracle
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taichi_soft import Material, OptionError, internal_forces
from taichi_soft.world.bare import bare_world

LAWS = ("st_venant_kirchhoff", "neo_hookean")
EACH_LAW = pytest.mark.parametrize("law", LAWS)
seeds = st.integers(0, 2**32 - 1)
I3 = np.eye(3)


def density(law, F, lam, mu):
    """Energy per volume at rest, from the papers."""
    if law == "st_venant_kirchhoff":
        E = (F.T @ F - I3) / 2
        return lam / 2 * np.trace(E) ** 2 + mu * np.sum(E * E)
    m, l = 4 / 3 * mu, lam + 5 / 6 * mu  # noqa: E741
    a = 1 + m / l - m / (4 * l)
    IC, J = np.sum(F * F), np.linalg.det(F)
    return m / 2 * (IC - 3) + l / 2 * (J - a) ** 2 - m / 2 * np.log(IC + 1)


def piola(law, F, lam, mu):
    """First Piola-Kirchhoff stress, from the papers."""
    if law == "st_venant_kirchhoff":
        E = (F.T @ F - I3) / 2
        return F @ (lam * np.trace(E) * I3 + 2 * mu * E)
    m, l = 4 / 3 * mu, lam + 5 / 6 * mu  # noqa: E741
    a = 1 + m / l - m / (4 * l)
    x, y, z = F.T
    cofactor = np.column_stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)])
    return m * (1 - 1 / (np.sum(F * F) + 1)) * F + l * (np.linalg.det(F) - a) * cofactor


def tets_of(mesh, material, x):
    """Corners, shape function gradients at rest (4, 3), V0, F and Lame parameters of every tetrahedron."""
    count = len(mesh.tets)
    young, nu = np.broadcast_to(material.young, count), np.broadcast_to(material.poisson, count)
    for tet, E, n in zip(mesh.tets, young, nu, strict=True):
        rest = mesh.vertices[tet]
        inverse = np.linalg.inv((rest[1:] - rest[0]).T)
        gradients = np.vstack([-inverse.sum(axis=0), inverse])
        volume = np.linalg.det((rest[1:] - rest[0]).T) / 6
        yield tet, gradients, volume, x[tet].T @ gradients, oracle.lame(E, n)


def forces_by_numpy(law, mesh, material, x):
    forces = np.zeros_like(x)
    for tet, gradients, volume, F, lame in tets_of(mesh, material, x):
        forces[tet] -= volume * gradients @ piola(law, F, *lame).T
    return forces


def energy_by_numpy(law, mesh, material, x):
    return sum(
        volume * (density(law, F, *lame) - density(law, I3, *lame))
        for _, _, volume, F, lame in tets_of(mesh, material, x)
    )


@EACH_LAW
@settings(max_examples=10)
@given(seed=seeds, name=st.sampled_from(list(oracle.MESHES)))
def test_forces_are_those_of_the_equations(law, seed, name):
    """Random deformation with flips, uneven material, to 1e-10 of the largest force."""
    rng = np.random.default_rng(seed)
    mesh = oracle.MESHES[name]
    material = oracle.uneven_material(mesh, rng)
    x = oracle.shaken(mesh, rng, 0.4)
    expected = forces_by_numpy(law, mesh, material, x)
    found = internal_forces(mesh, material, x, law=law)
    np.testing.assert_allclose(found, expected, atol=1e-10 * np.abs(expected).max())


@EACH_LAW
@settings(max_examples=10)
@given(seed=seeds)
def test_forces_are_minus_the_gradient_of_the_energy(law, seed):
    """The reference is central differences of the energy in NumPy, in five random directions."""
    rng = np.random.default_rng(seed)
    mesh = oracle.MESHES["box"]
    material = oracle.uneven_material(mesh, rng)
    x = oracle.shaken(mesh, rng, 0.3)
    forces = internal_forces(mesh, material, x, law=law)
    for _ in range(5):
        d = rng.normal(size=x.shape)
        h = 1e-5
        high, low = (energy_by_numpy(law, mesh, material, x + s * h * d) for s in (1, -1))
        scale = np.abs(forces).max() * np.abs(d).sum()
        assert (high - low) / (2 * h) == pytest.approx(-np.sum(forces * d), abs=1e-7 * scale)


@EACH_LAW
@settings(max_examples=10)
@given(seed=seeds, name=st.sampled_from(list(oracle.MESHES)))
def test_forces_and_torques_sum_to_zero(law, seed, name):
    rng = np.random.default_rng(seed)
    mesh = oracle.MESHES[name]
    x = oracle.shaken(mesh, rng, 0.4)
    forces = internal_forces(mesh, oracle.uneven_material(mesh, rng), x, law=law)
    scale = np.abs(forces).max() * len(x)
    np.testing.assert_allclose(forces.sum(axis=0), 0, atol=1e-12 * scale)
    np.testing.assert_allclose(np.cross(x, forces).sum(axis=0), 0, atol=1e-12 * scale)


@EACH_LAW
@settings(max_examples=10)
@given(seed=seeds, name=st.sampled_from(list(oracle.MESHES)))
def test_no_force_at_rest_wherever_the_body_lies(law, seed, name):
    rng = np.random.default_rng(seed)
    mesh = oracle.MESHES[name]
    x = mesh.vertices @ oracle.rotation(rng).T + rng.normal(size=3)
    forces = internal_forces(mesh, Material(1e6, 0.4, 1000.0, damping_ratio=0.0), x, law=law)
    assert np.abs(forces).max() < 1e6 * 1e-13


@EACH_LAW
@settings(max_examples=10)
@given(seed=seeds, nu=st.floats(-0.9, 0.45))
def test_small_strain_is_hookes(law, seed, nu):
    """Against the virial law: the difference is of second order."""
    rng = np.random.default_rng(seed)
    mesh = oracle.MESHES["sphere"]
    material = Material(1e6, nu, 1000.0, damping_ratio=0.0)
    noise = rng.normal(size=mesh.vertices.shape)
    gaps = []
    for size in (1e-3, 1e-4):
        x = mesh.vertices + size * noise
        gap = internal_forces(mesh, material, x, law=law) - internal_forces(mesh, material, x)
        gaps.append(np.abs(gap).max())
    assert gaps[0] / gaps[1] == pytest.approx(100, rel=0.15)


def work_round_a_circle(material, **options):
    """Return the net work on a closed path of one tetrahedron, divided by the sum of absolute work."""
    mesh = oracle.ONE_TET

    def pose(s):
        a, b, c = np.sin(s), np.cos(s) - 1, np.sin(2 * s)
        F = I3 + 0.4 * np.array([[a, -b / 2, 0], [0, b, 0.3 * c], [0, 0, a]])
        return mesh.vertices @ F.T

    powers = []
    for s in np.linspace(0, 2 * np.pi, 401)[:-1]:
        velocity = (pose(s + 1e-6) - pose(s - 1e-6)) / 2e-6
        powers.append(np.sum(internal_forces(mesh, material, pose(s), **options) * velocity))
    # The trapezoidal rule converges faster than any power for periodic functions.
    return abs(np.sum(powers)) / np.sum(np.abs(powers))


@pytest.mark.parametrize("nu", [-0.3, 0.0, 0.25, 0.4])
@EACH_LAW
def test_a_closed_path_takes_no_work(law, nu):
    assert work_round_a_circle(Material(1e5, nu, 1000.0, damping_ratio=0.0), law=law) < 1e-7


@pytest.mark.parametrize(("strain", "free"), [("linear", 1 / 4), ("exact", 1 / 3)])
def test_the_thesiss_laws_take_work_round_a_closed_path_but_at_one_poissons_ratio(strain, free):
    """An energy exists only at nu = 1/4 for eq. 6.7, and at nu = 1/3 for the exact strain."""
    work = {
        nu: work_round_a_circle(Material(1e5, nu, 1000.0, damping_ratio=0.0), strain=strain)
        for nu in (0.0, 0.1, free, 0.45)
    }
    assert work.pop(free) < 1e-7
    assert min(work.values()) > 1e-3


@settings(max_examples=20)
@given(s=st.floats(-0.3, 1.0))
def test_st_venant_kirchhoff_in_pure_tension_is_a_cubic(s):
    """nu = 0: F = E A (1 + s)(s + s^2/2)."""
    mesh = oracle.MESHES["box"]
    size = np.ptp(mesh.vertices, axis=0)
    forces = internal_forces(
        mesh,
        Material(1e6, 0.0, 1000.0, damping_ratio=0.0),
        mesh.vertices * (1, 1, 1 + s),
        law="st_venant_kirchhoff",
    )
    top = mesh.vertices[:, 2] > mesh.vertices[:, 2].max() - 1e-9
    pull = -forces[top, 2].sum()
    assert pull == pytest.approx(1e6 * size[0] * size[1] * (1 + s) * (s + s * s / 2), rel=1e-9, abs=1e-6)


def test_a_mirrored_body_is_at_rest_by_st_venant_kirchhoff_and_not_by_neo_hooke():
    mesh = oracle.MESHES["sphere"]
    x = mesh.vertices * (1, 1, -1)
    material = Material(1e6, 0.3, 1000.0, damping_ratio=0.0)
    still, driven = (np.abs(internal_forces(mesh, material, x, law=law)).max() for law in LAWS)
    assert still < 1e-6
    assert driven > 1e3


@settings(max_examples=10)
@given(seed=seeds, nu=st.floats(-0.5, 0.45))
def test_a_neo_hookean_tetrahedron_rolls_back_to_its_shape_from_any_pose(seed, nu):
    """Downhill along its forces from random corners, half of them inside out, until all stretches are 1."""
    rng = np.random.default_rng(seed)
    mesh, material = oracle.ONE_TET, Material(1.0, nu, 1.0, damping_ratio=0.0)
    x = rng.normal(size=(4, 3))
    for _ in range(2500):
        force = internal_forces(mesh, material, x, law="neo_hookean")
        if np.abs(force).max() < 1e-6:
            break
        x = x + force * min(0.2, 0.05 / np.abs(force).max())
    rest = mesh.vertices[1:] - mesh.vertices[0]
    stretches = np.linalg.svd(np.linalg.solve(rest, x[1:] - x[0]), compute_uv=False)
    np.testing.assert_allclose(stretches, 1, atol=1e-4)
    assert np.linalg.det(x[1:] - x[0]) > 0


@pytest.mark.parametrize("schedule", ["per_body", pytest.param("flat", marks=pytest.mark.soak)])
@EACH_LAW
def test_a_ringing_body_keeps_its_energy_without_damping(law, schedule):
    """Ten seconds in free flight: leapfrog keeps the sum within 2 %, up and down, with no trend."""
    mesh = oracle.MESHES["box"]
    world = bare_world(gravity=(0, 0, 0), floor=None, schedule=schedule, retries=0)
    body = world.add_body(mesh, Material(1e5, 0.4, 1000.0, damping_ratio=0.0), law=law)
    world.build()
    body.set_motion(mesh.vertices * (1.2, 0.9, 1.0), np.zeros_like(mesh.vertices))
    substeps = 4 * world.stable_substeps(1 / 50)
    sums = []
    for _ in range(500):
        world.step(1 / 50, substeps)
        sums.append(body.kinetic_energy() + body.elastic_energy())
    early, late = np.mean(sums[:100]), np.mean(sums[-100:])
    assert sums[0] > 100
    assert late == pytest.approx(early, rel=0.01)
    assert np.ptp(sums) < 0.02 * early


@EACH_LAW
def test_the_energy_of_a_body_is_that_of_the_equations(law):
    mesh = oracle.MESHES["box"]
    rng = np.random.default_rng(5)
    material = oracle.uneven_material(mesh, rng)
    world = bare_world(floor=None, retries=0)
    body = world.add_body(mesh, material, law=law)
    world.build()
    assert body.elastic_energy() == pytest.approx(0, abs=1e-3)
    body.set_motion(oracle.shaken(mesh, rng, 0.3), np.zeros_like(mesh.vertices))
    expected = energy_by_numpy(law, mesh, material, body.positions().astype(float))
    assert body.elastic_energy() == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("law", "option", "value", "taken"),
    [
        ("st_venant_kirchhoff", "flips", "recover", "'tolerant'"),
        ("st_venant_kirchhoff", "strain", "exact", "'linear'"),
        ("neo_hookean", "flips", "tolerant", "'recover'"),
        ("neo_hookean", "strain", "linear", "leave strain out"),
    ],
)
def test_options_that_an_energy_leaves_no_room_for_are_refused(law, option, value, taken):
    mesh = oracle.ONE_TET
    with pytest.raises(OptionError, match=f"{law}.*{option}='{value}'.*{taken}"):
        internal_forces(
            mesh, Material(1e5, 0.2, 1.0, damping_ratio=0.0), mesh.vertices, law=law, **{option: value}
        )
