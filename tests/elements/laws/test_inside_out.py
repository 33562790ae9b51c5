"""Tetrahedra turned inside out, through a face, an edge or a point, and whole bodies in their mirror image.

`tolerant` is at rest in the mirror, `off` is not handled, `recover` finds back to its own orientation.
"""

import force_oracle as oracle
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taichi_soft import Material, TetMesh, internal_forces

pytestmark = pytest.mark.kernel

REST = oracle.ONE_TET.vertices
MESHES = oracle.MESHES
EACH_MODE = pytest.mark.parametrize(("law", "strain", "flips"), oracle.params_of(oracle.MODES))
EACH_STRAIN = pytest.mark.parametrize("strain", oracle.EACH_STRAIN)
EACH_LAW_AND_STRAIN = pytest.mark.parametrize(
    ("strain", "law"),
    [
        ("linear", "virial"),
        ("linear", "face"),
        ("exact", "virial"),
        pytest.param("exact", "face", marks=pytest.mark.soak),
    ],
)
MATERIAL = Material(1e6, 0.3, 1000.0)
NU_ZERO = Material(1e6, 0.0, 1000.0)
seeds = st.integers(0, 2**32 - 1)

# Apex above an equilateral base in the plane z = 0, all edges 1 m.
HEIGHT = np.sqrt(2 / 3)
BASE_AREA = np.sqrt(3) / 4
REGULAR = TetMesh(
    [[0, 0, HEIGHT], [1 / np.sqrt(3), 0, 0], [-np.sqrt(1 / 12), 0.5, 0], [-np.sqrt(1 / 12), -0.5, 0]],
    [[0, 1, 2, 3]],
    fix_orientation=True,
)


def through_the_face(x):
    """The first corner in its mirror image behind the opposite face."""
    normal = np.cross(x[2] - x[1], x[3] - x[1])
    normal /= np.linalg.norm(normal)
    y = x.copy()
    y[0] -= 2 * np.dot(x[0] - x[1], normal) * normal
    return y


def through_the_edge(x):
    """The edge 0-1 pushed past the edge 2-3, in the plane that holds the latter and faces corner 0."""
    along = x[3] - x[2]
    across = np.cross(along, np.cross(along, x[0] - x[2]))
    across /= np.linalg.norm(across)
    return x - 2 * np.outer((x - x[2]) @ across, across)


def through_the_point(x):
    """Every corner on the other side of the centre."""
    return 2 * x.mean(axis=0) - x


FLIPPED = pytest.mark.parametrize(
    "mirror", [through_the_face, through_the_edge, through_the_point], ids=["face", "edge", "point"]
)
FLIPPED_WITH_STRAIN = pytest.mark.parametrize(
    ("mirror", "strain"),
    [
        pytest.param(through_the_face, "linear", id="face-linear"),
        pytest.param(through_the_face, "exact", id="face-exact", marks=pytest.mark.soak),
        pytest.param(through_the_edge, "linear", id="edge-linear"),
        pytest.param(through_the_edge, "exact", id="edge-exact"),
        pytest.param(through_the_point, "linear", id="point-linear"),
        pytest.param(through_the_point, "exact", id="point-exact"),
    ],
)


def forces_of(x, mode, mesh=oracle.ONE_TET, material=MATERIAL):
    law, strain, flips = mode
    return internal_forces(mesh, material, x, law=law, strain=strain, flips=flips)


@FLIPPED
def test_these_poses_are_inside_out_and_congruent_to_the_rest_shape(mirror):
    x = mirror(REST)
    assert oracle.signed_volume(x) == pytest.approx(-oracle.signed_volume(REST))
    np.testing.assert_allclose(
        np.linalg.norm(x[:, None] - x, axis=2), np.linalg.norm(REST[:, None] - REST, axis=2), atol=1e-12
    )


@FLIPPED
@EACH_LAW_AND_STRAIN
def test_tolerant_is_at_rest_in_its_mirror_image(mirror, law, strain):
    assert np.abs(forces_of(mirror(REST), (law, strain, "tolerant"))).max() < 1e-8


@EACH_LAW_AND_STRAIN
@settings(max_examples=10)
@given(seed=seeds, name=st.sampled_from(list(MESHES)), amount=st.floats(0.01, 1))
def test_tolerant_feels_the_mirrored_force_in_the_mirrored_body(law, strain, seed, name, amount):
    """f(Q x) = Q f(x) for reflections Q as well as for rotations: the whole body mirrored."""
    rng = np.random.default_rng(seed)
    mesh = MESHES[name]
    x = oracle.shaken(mesh, rng, amount)
    Q = np.diag([1, 1, -1]) @ oracle.rotation(rng)
    before, after = (forces_of(y, (law, strain, "tolerant"), mesh) for y in (x, x @ Q.T))
    np.testing.assert_allclose(after, before @ Q.T, atol=1e-10 * np.abs(before).max())


@EACH_LAW_AND_STRAIN
@settings(max_examples=6)
@given(seed=seeds)
def test_off_feels_the_opposite_of_it(law, strain, seed):
    """The mirrored body is at rest, but its forces drive it away instead of back."""
    rng = np.random.default_rng(seed)
    mesh = MESHES["sphere"]
    x = oracle.shaken(mesh, rng, 0.2)
    Q = np.diag([1, 1, -1]) @ oracle.rotation(rng)
    before, after = (forces_of(y, (law, strain, "off"), mesh) for y in (x, x @ Q.T))
    np.testing.assert_allclose(after, -before @ Q.T, atol=1e-10 * np.abs(before).max())


@EACH_STRAIN
@settings(max_examples=10)
@given(seed=seeds)
def test_upright_tetrahedra_do_not_know_how_flips_are_handled(strain, seed):
    rng = np.random.default_rng(seed)
    x = oracle.ONE_TET.vertices @ oracle.stretched_rotation(rng, 0.1, 3.0).T
    tolerant, off, recover = (forces_of(x, ("virial", strain, flips)) for flips in oracle.FLIPS)
    np.testing.assert_allclose(off, tolerant, atol=1e-12 * np.abs(tolerant).max())
    np.testing.assert_allclose(recover, tolerant, atol=1e-12 * np.abs(tolerant).max())


def apex_force(stretch, strain, flips, material=NU_ZERO):
    """Upward force on the apex of a regular tetrahedron whose height is `stretch` times that at rest."""
    x = REGULAR.vertices * [1, 1, stretch]
    forces = internal_forces(REGULAR, material, x, strain=strain, flips=flips)
    apex = int(np.argmax(REGULAR.vertices[:, 2]))
    np.testing.assert_allclose(forces[apex, :2], 0, atol=1e-6)
    return forces[apex, 2]


@EACH_STRAIN
@pytest.mark.parametrize("flips", oracle.FLIPS)
@pytest.mark.parametrize("s", [1.5, 1.0, 0.5, 0.01, -0.01, -0.3, -0.9, -1.1, -2.0])
def test_force_on_an_apex_pushed_through_the_base_in_closed_form(strain, flips, s):
    """E A / 3 times the strain along the height; the base and its area stay as they are."""
    if flips == "recover" and s < 0:
        # Beyond -1 the height is not the smallest stretch any more: two of the base's are.
        if s < -1:
            assert apex_force(s, strain, flips) != 0
            return
        value = s - 1 if s < -1 / 16 else 17 * s
    else:
        value = (s * s - 1) / 2 if strain == "linear" else abs(s) - 1
    sign = -1 if flips == "tolerant" and s < 0 else 1
    expected = -sign * 1e6 * value * BASE_AREA / 3
    assert apex_force(s, strain, flips) == pytest.approx(expected, rel=1e-9, abs=1e-6)


@EACH_STRAIN
def test_off_pushes_a_shallow_flip_back_and_one_past_its_mirror_runs_away(strain):
    for nu in (0.0, 0.3):
        material = Material(1e6, nu, 1000.0)
        for s in (-0.01, -0.3, -0.9):
            assert apex_force(s, strain, "off", material) > 0  # up, towards its original side
        pushes = [apex_force(s, strain, "off", material) for s in (-1.1, -1.5, -2.0, -4.0)]
        assert max(pushes) < 0  # down, and ever harder
        assert pushes == sorted(pushes, reverse=True)


@EACH_STRAIN
def test_tolerant_settles_in_the_mirror_from_either_side(strain):
    """A dent stays a dent, and nothing runs away."""
    assert min(apex_force(s, strain, "tolerant") for s in (-1.1, -1.5, -4.0)) > 0
    assert max(apex_force(s, strain, "tolerant") for s in (-0.01, -0.5, -0.9)) < 0


def opening_powers(x, forces):
    """Power of the forces if each principal stretch grows by 1 per second, a negative one towards zero."""
    axes, _, turn = np.linalg.svd(oracle.deformation(REST, x))
    signs = np.array([1, 1, np.sign(oracle.signed_volume(x))])
    arms = REST - REST[0]
    return np.array(
        [s * np.sum(forces * np.outer(arms @ v, u)) for s, u, v in zip(signs, axes.T, turn, strict=True)]
    )


@EACH_LAW_AND_STRAIN
@settings(max_examples=25)
@given(seed=seeds, nu=st.floats(0, 0.45))
def test_recover_brings_every_axis_of_a_flip_nearer_to_its_length_at_rest(law, strain, seed, nu):
    """Stretched axes shrink, compressed ones grow, the negative one grows towards +1."""
    rng = np.random.default_rng(seed)
    F = oracle.stretched_rotation(rng, 0.02, 3.0) @ np.diag([1, 1, -1])
    x = REST @ F.T + rng.normal(size=3)
    assert oracle.signed_volume(x) < 0
    powers = opening_powers(x, forces_of(x, (law, strain, "recover"), material=Material(1e6, nu, 1000.0)))
    stretches = np.linalg.svd(F, compute_uv=False)
    assert powers[2] > 0
    for k in (0, 1):
        assert powers[k] * (1 - stretches[k]) > 0


@pytest.mark.parametrize("thinnest", [0.5, 0.1, 0.05, 0.01])
@settings(max_examples=10)
@given(seed=seeds, nu=st.floats(0, 0.45))
def test_the_force_on_a_flip_that_recovers_is_the_slope_of_an_energy(thinnest, seed, nu):
    """The reference is central differences. A force with an energy does no work on a closed path."""
    rng = np.random.default_rng(seed)
    stretches = [*rng.uniform(thinnest + 0.1, 2.0, 2), -thinnest]
    x = REST @ (oracle.rotation(rng) @ np.diag(stretches) @ oracle.rotation(rng)).T
    lame_lambda, lame_mu = oracle.lame(1e6, nu)
    slopes = np.zeros((4, 3))
    for at in np.ndindex(4, 3):
        step = np.zeros((4, 3))
        step[at] = 1e-6
        after, before = (
            oracle.recovery_energy(REST, x + move, lame_lambda + 2 * lame_mu) for move in (step, -step)
        )
        slopes[at] = (after - before) / 2e-6
    forces = forces_of(x, ("virial", "linear", "recover"), material=Material(1e6, nu, 1000.0))
    np.testing.assert_allclose(forces, -slopes, atol=1e-5 * np.abs(slopes).max())


@EACH_STRAIN
@settings(max_examples=25)
@given(seed=seeds)
def test_recover_gains_volume_from_a_flip_of_about_the_size_at_rest(strain, seed):
    """sum f_i . dV/dx_i > 0 for stretches between 0.6 and 1.1 and a thinner third one inside out.

    Of a regular tetrahedron at nu = 0: much smaller ones first grow along the other two axes.
    """
    rng = np.random.default_rng(seed)
    axes, turn = oracle.rotation(rng), oracle.rotation(rng)
    x = REGULAR.vertices @ (axes @ np.diag([*rng.uniform(0.6, 1.1, 2), -rng.uniform(0.0, 0.6)]) @ turn).T
    forces = forces_of(x, ("virial", strain, "recover"), REGULAR, NU_ZERO)
    corners = REGULAR.tets[0]
    assert oracle.signed_volume(x[corners]) < 0
    assert np.sum(forces[corners] * oracle.volume_gradient(x[corners])) > 0


def settled(x, mesh, strain, flips, steps=1500):
    """Return the end of a steepest descent along the forces."""
    for _ in range(steps):
        x = x + 4e-7 * internal_forces(mesh, NU_ZERO, x, strain=strain, flips=flips)
    return x


@FLIPPED_WITH_STRAIN
def test_recover_returns_from_every_mirror_to_the_rest_shape(mirror, strain):
    noise = np.random.default_rng(0).normal(scale=1e-3, size=(4, 3))
    x = settled(mirror(REST) + noise, oracle.ONE_TET, strain, "recover")
    assert oracle.signed_volume(x) == pytest.approx(oracle.signed_volume(REST), rel=1e-6)
    F = oracle.deformation(REST, x)
    np.testing.assert_allclose(F @ F.T, np.eye(3), atol=1e-6)


@EACH_STRAIN
@pytest.mark.parametrize("seed", range(6))
def test_recover_returns_from_any_pose(strain, seed):
    """The corners are at random positions, so the tetrahedra are stretched or inverted."""
    x = np.random.default_rng(seed).uniform(-1, 1, size=(4, 3)) * (1 if seed % 2 else 3)
    if oracle.signed_volume(x) > 0:
        x = x[[1, 0, 2, 3]]
    x = settled(x, oracle.ONE_TET, strain, "recover")
    assert oracle.signed_volume(x) == pytest.approx(oracle.signed_volume(REST), rel=1e-6)


@FLIPPED_WITH_STRAIN
def test_tolerant_stays_inside_out(mirror, strain):
    noise = np.random.default_rng(0).normal(scale=1e-3, size=(4, 3))
    x = settled(mirror(REST) + noise, oracle.ONE_TET, strain, "tolerant")
    assert oracle.signed_volume(x) == pytest.approx(-oracle.signed_volume(REST), rel=1e-6)


def around_flat(seed, volume):
    """One random pose with a corner moved so that the signed volume is +volume, and one with -volume."""
    rng = np.random.default_rng(seed)
    double_area = 0.0
    while double_area < 0.5:  # so that a small volume means a small height
        x = rng.uniform(-1, 1, size=(4, 3))
        normal = np.cross(x[2] - x[1], x[3] - x[1])
        double_area = np.linalg.norm(normal)
    normal /= double_area
    x[0] -= np.dot(x[0] - x[1], normal) * normal
    poses = [x.copy(), x.copy()]
    for pose, v in zip(poses, (volume, -volume), strict=True):
        pose[0] -= normal * v * 6 / double_area  # the corner lies below its face in an upright tetrahedron
        assert oracle.signed_volume(pose) == pytest.approx(v, rel=1e-5)
    return poses


@pytest.mark.parametrize(
    ("law", "strain", "flips"), oracle.params_of(mode for mode in oracle.MODES if mode[2] != "recover")
)
@settings(max_examples=8)
@given(seed=seeds)
def test_forces_are_continuous_through_flat_except_where_the_mirror_is_tolerated(law, strain, flips, seed):
    """At volumes of plus and minus 1e-9 m^3: the same force, but with `tolerant` the opposite one."""
    above, below = (forces_of(x, (law, strain, flips)) for x in around_flat(seed, 1e-9))
    expected = -below if flips == "tolerant" else below
    np.testing.assert_allclose(above, expected, atol=1e-5 * np.abs(above).max() + 0.1)  # of E A = 1e6 N


@EACH_STRAIN
@settings(max_examples=15)
@given(seed=seeds)
def test_a_tetrahedron_that_is_squeezed_flat_is_opened_again(strain, seed):
    """Just upright or just flipped, `recover` pushes the corner to its own side of the face."""
    F = oracle.stretched_rotation(np.random.default_rng(seed), 0.3, 1.0)
    axes, stretches, turn = np.linalg.svd(F)
    for s in (1e-9, -1e-3):
        flat = axes @ np.diag([stretches[0], stretches[1], s]) @ turn
        x = REST @ flat.T
        forces = forces_of(x, ("virial", strain, "recover"))
        assert np.sum(forces * oracle.volume_gradient(x)) > 0


A, B, C = REST[0], REST[1], REST[2]
DEGENERATE = {
    "flat": REST * [1, 1, 0],
    "flat and askew": REST @ np.array([[1, 0, 0.5], [0, 1, 0.3], [0, 0, 0]]),
    "two corners in one": np.array([A, A, B, C]),
    "two pairs": np.array([A, A, B, B]),
    "on a line": np.outer([0.0, 1.0, -0.5, 2.0], [1.0, 2.0, 3.0]),
    "a line along x": REST * [1, 0, 0],
    "three corners in one": np.array([A, A, A, B]),
    "a point": np.tile(A, (4, 1)),
    "the origin": np.zeros((4, 3)),
    "almost a point": REST * 1e-20,
    "almost a line": REST * [1, 1e-18, -1e-18],
    "far too large": REST * 1e6,
}


@EACH_MODE
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_degenerate_shapes_have_finite_forces_that_sum_to_zero(law, strain, flips, dtype):
    v = np.random.default_rng(1).normal(size=(4, 3))
    material = Material(1e6, 0.3, 1000.0, 10.0)
    for name, x in DEGENERATE.items():
        forces = internal_forces(
            oracle.ONE_TET, material, x, v, law=law, strain=strain, flips=flips, dtype=dtype
        )
        assert np.isfinite(forces).all(), name
        scale = max(np.abs(forces).max(), 1e-30)
        assert np.abs(forces.sum(axis=0)).max() <= 1e2 * np.finfo(dtype).eps * scale, name


@EACH_MODE
def test_no_force_is_left_in_a_body_that_is_one_point(law, strain, flips):
    """Its faces have no area for a stress to act on."""
    mesh = MESHES["sphere"]
    forces = forces_of(np.ones_like(mesh.vertices), (law, strain, flips), mesh)
    assert np.abs(forces).max() == 0


@EACH_MODE
def test_one_tetrahedron_inside_out_leaves_the_rest_of_the_body_alone(law, strain, flips):
    """One vertex of a sphere is pushed through the opposite face of one of its tetrahedra."""
    mesh = MESHES["sphere"]
    x = mesh.vertices.copy()
    tet = mesh.tets[0]
    x[tet] = through_the_face(x[tet])
    expected = oracle.elastic_forces(mesh, 1e6, 0.3, x, strain, flips)
    forces = forces_of(x, (law, strain, flips), mesh)
    touched = np.unique(mesh.tets[(mesh.tets == tet[0]).any(axis=1)])
    outside = np.setdiff1d(np.arange(len(x)), touched)
    assert np.abs(forces[outside]).max() < 1e-8 < 1 < np.abs(forces[touched]).max()
    if flips != "recover":  # the axis that a mirrored rest shape recovers along is any
        np.testing.assert_allclose(forces, expected, atol=1e-9 * np.abs(expected).max())


@FLIPPED
def test_volume_springs_are_at_rest_in_their_mirror_image(mirror):
    """A volume counts without its sign, or the tetrahedron would push its edges apart and run away."""
    forces = internal_forces(oracle.ONE_TET, MATERIAL, mirror(REST), law="volume_springs")
    assert np.abs(forces).max() < 1e-8
    stretched = REST * (1, 1, 1.1)
    expected = internal_forces(oracle.ONE_TET, MATERIAL, stretched, law="volume_springs")
    mirrored = internal_forces(oracle.ONE_TET, MATERIAL, stretched * (1, 1, -1), law="volume_springs")
    np.testing.assert_allclose(mirrored, expected * (1, 1, -1), atol=1e-9 * np.abs(expected).max())
