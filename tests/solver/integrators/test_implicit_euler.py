"""Implicit Euler: its solve against NumPy, rest shapes as by leapfrog, steps that leapfrog cannot take."""

import warnings

import numpy as np
import pytest

from taichi_soft import (
    LAWS,
    FrozenBodyWarning,
    Material,
    OptionError,
    ParticleMesh,
    SolverWarning,
    SpringMaterial,
    box,
    cloth,
    cloth_constants,
    force_gradient,
    internal_forces,
    rope,
    sphere,
)
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak


def make_world(mesh, material, *, floor=None, integrator="implicit_euler", **options):
    world = bare_world(floor=floor, integrator=integrator, **options.pop("world", {}))
    body = world.add_body(mesh, material, **options)
    world.build()
    return world, body


def without_rotation(stiffness, masses, x, h):
    """P^T K P: P takes the rotation of a body off its velocities, by its angular momentum and inertia tensor.

    The tensor has a little added: a millionth of its trace, and what a sphere of radius h^2 g would have.
    """
    arms = x - masses @ x / masses.sum()
    turns = np.cross(np.eye(3)[None], arms[:, None]).transpose(0, 2, 1).reshape(-1, 3)  # velocities of each
    momenta = turns.T * np.repeat(masses, 3)
    inertia = momenta @ turns
    inertia += (1e-6 * np.trace(inertia) + masses.sum() * (h * h * 9.81) ** 2) * np.eye(3)
    beside = np.eye(x.size) - turns @ np.linalg.solve(inertia, momenta)
    return beside.T @ stiffness @ beside


def test_a_step_of_springs_solves_eq_3_26_with_the_outer_products():
    """Matrices written here in NumPy float64, springs pressed and stretched, one particle pinned."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0.2, 0.9, 0.1], [0.3, 0.2, 1.0]])
    mesh = ParticleMesh(points, [[0, 1], [1, 2], [2, 3], [0, 3], [0, 2]], [1.0, 2.0, 0.5, 1.5])
    k, b = np.array([10.0, 200, 30, 400, 50]), np.array([0.1, 0.5, 0.2, 0.3, 0.0])
    rest = mesh.edge_lengths * np.array([0.8, 1.1, 0.9, 1.2, 1.0])
    v = np.random.default_rng(0).normal(size=points.shape)
    world, body = make_world(
        mesh, SpringMaterial(k, b, rest), law="springs", pinned=[1], world={"tolerance": 1e-6}
    )
    v[1] = 0
    body.set_motion(points, v)
    h = 0.05
    world.step(h)

    K, D, f = np.zeros((12, 12)), np.zeros((12, 12)), mesh.masses[:, None] * np.array([0, 0, -9.81])
    for e, (p, q) in enumerate(mesh.edges):
        r = points[q] - points[p]
        length = np.linalg.norm(r)
        n = r / length
        f[p] += (k[e] * (length - rest[e]) + b[e] * n @ (v[q] - v[p])) * n
        f[q] -= (k[e] * (length - rest[e]) + b[e] * n @ (v[q] - v[p])) * n
        nn = np.outer(n, n)
        stiff = k[e] * (nn + max(0.0, 1 - rest[e] / length) * (np.eye(3) - nn))
        for matrix, block in ((K, stiff), (D, b[e] * nn)):
            for i, j, sign in ((p, p, 1), (q, q, 1), (p, q, -1), (q, p, -1)):
                matrix[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] += sign * block
    K = without_rotation(K, mesh.masses, points, h)
    A = np.diag(np.repeat(mesh.masses, 3)) + h * D + h * h * K
    rhs = h * (f.ravel() - h * K @ v.ravel())
    free = np.repeat(np.arange(4) != 1, 3)
    change = np.zeros(12)
    change[free] = np.linalg.solve(A[np.ix_(free, free)], rhs[free])
    expected = v + change.reshape(-1, 3)
    np.testing.assert_allclose(body.velocities(), expected, atol=2e-5)
    np.testing.assert_allclose(body.positions(), points + h * expected, atol=2e-6)


# Without those that share their gradients and damping with a neighbour.
STEPPED = [(law, "edge") for law in LAWS if law not in ("face", "tilted_plane_printed")] + [
    ("virial", "tet_mean")
]


@pytest.mark.parametrize(("law", "damping_model"), STEPPED)
def test_a_step_of_every_law_solves_with_its_projected_gradient_and_damping(law, damping_model):
    """(M + h D + h^2 K) dv = h (f - h K v) in NumPy; D by the damping forces of unit velocities."""
    mesh = sphere(0.7, 1)
    across = {"shear_damping": 500.0} if getattr(LAWS[law], "takes_shear", False) else {}
    material = Material(1e5, 0.3, 1000.0, 1000.0, damping_ratio=0.0, **across)
    world, body = make_world(mesh, material, law=law, damping_model=damping_model, world={"tolerance": 1e-6})
    rng = np.random.default_rng(1)
    x = (mesh.vertices + 0.03 * rng.normal(size=mesh.vertices.shape)).astype(np.float32).astype(float)
    v = rng.normal(size=x.shape).astype(np.float32).astype(float)
    body.set_motion(x, v)
    h = 0.02
    world.step(h)
    n = x.size
    options = {"law": law, "damping_model": damping_model}
    K = -force_gradient(mesh, material, x, law=law, projected=True).reshape(n, n)
    still = internal_forces(mesh, material, x, **options).ravel()
    units = np.eye(n).reshape(n, -1, 3)
    D = np.stack([still - internal_forces(mesh, material, x, u, **options).ravel() for u in units], axis=1)
    assert np.abs(D).max() > 1.0
    K = without_rotation(K, body.masses, x, h)
    f = internal_forces(mesh, material, x, v, **options) + body.masses[:, None] * np.array([0, 0, -9.81])
    A = np.diag(np.repeat(body.masses, 3)) + h * D + h * h * K
    change = np.linalg.solve(A, h * (f.ravel() - h * K @ v.ravel())).reshape(-1, 3)
    np.testing.assert_allclose(body.velocities(), v + change, atol=2e-3 * np.abs(change).max())
    assert 0 < body.solve_residual <= 1e-6


SOFT = Material(1e5, 0.3, 1000.0, 10.0, damping_ratio=0.0)


@pytest.mark.parametrize("dt", [1 / 4, 1 / 10, 1 / 60])
@pytest.mark.parametrize("law", ["virial", "springs", "cmpm2"])
def test_a_fall_that_ends_within_a_step_ends_on_the_floor(law, dt):
    """The step is made in pieces where its edges would change too much at once; no step is too long."""
    ball = sphere(0.5, 2)
    world, body = make_world(
        ball, Material(4e5, 0.3, 1000.0, 10.0, damping_ratio=0.0), floor=0.0, law=law, position=(0, 0, 1.5)
    )
    for _ in range(round(10 / dt)):
        world.step(dt)
        assert np.abs(body.positions()).max() < 2.1
    assert not body.is_frozen
    ends = body.positions().astype(float)[ball.edges]
    stretch = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / ball.edge_lengths - 1
    assert np.abs(stretch).max() < 0.5
    assert body.flipped_count() == 0
    assert body.positions()[:, 2].min() < 0.05


@pytest.mark.parametrize(("law", "flips"), [("virial", "recover"), ("neo_hookean", "recover")])
@pytest.mark.parametrize(("amount", "seed"), [(0.1, 0), (0.3, 0), *((0.5, seed) for seed in range(6))])
def test_a_scrambled_body_finds_its_shape_again_at_one_step_a_frame(law, flips, amount, seed):
    """Every vertex thrown by a normal distribution of `amount` metres, in a ball of half a metre that moves.

    Its steps are wilder than what 32 pieces can follow: they lose speed, but no momentum.
    """
    ball = sphere(0.5, 2)
    world, body = make_world(ball, SOFT, law=law, flips=flips, world={"gravity": (0, 0, 0)})
    noise = np.random.default_rng(seed).normal(size=ball.vertices.shape)
    body.set_motion(ball.vertices + amount * noise, np.full_like(noise, 2.0))
    for _ in range(300):
        world.step(1 / 60)
    momentum = body.masses.astype(float) @ body.velocities().astype(float)
    np.testing.assert_allclose(momentum / body.masses.sum(), 2.0, atol=0.2)  # particles flew at 200 m/s
    assert not body.is_frozen
    assert body.flipped_count() == 0
    ends = body.positions().astype(float)[ball.edges]
    np.testing.assert_allclose(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), ball.edge_lengths, rtol=0.05)


@pytest.mark.parametrize(("law", "damping_model"), [("virial", "tet_mean"), ("volume_springs", "edge")])
def test_a_step_in_one_piece_does_not_depend_on_how_others_fare(law, damping_model):
    """A ball that comes to rest between two that are thrown about moves bit for bit as alone."""
    ball = sphere(0.4, 1)
    noise = np.random.default_rng(1).normal(size=ball.vertices.shape)
    paths = []
    for places in ((0,), (0, -3, 3)):
        world = bare_world(integrator="implicit_euler")
        options = {"law": law, "damping_model": damping_model}
        bodies = {  # from left to right, so that the calm one is neither the first nor the last
            x: world.add_body(ball, SOFT, position=(x, 0, 3 if x else 0.5), **options) for x in sorted(places)
        }
        world.build()
        for x in places[1:]:
            bodies[x].set_motion(bodies[x].positions() + 0.3 * noise, 5 * noise)
        for _ in range(30):
            world.step(1 / 60)
        paths.append(bodies[0].positions())
    assert np.array_equal(*paths)


def test_a_pinned_cloth_hangs_in_the_same_shape_as_by_leapfrog():
    cells = (8, 8)
    down = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]  # otherwise it would swing about its pins without damping
    mesh = cloth((1.0, 1.0), cells, 0.3)
    stiffness = cloth_constants(mesh, cells, tensile=200.0, shear=100.0, bend=5.0)
    material = SpringMaterial(stiffness, 0.3)
    shapes = {}
    for integrator, dt, steps in (("leapfrog", 1 / 120, 4000), ("implicit_euler", 1 / 30, 900)):
        world, body = make_world(
            mesh,
            material,
            integrator=integrator,
            law="springs",
            pinned=[0, 8],
            position=(0, 0, 1.5),
            rotation=down,
        )
        for _ in range(steps):
            world.step(dt)
        assert np.abs(body.velocities()).max() < 1e-3
        shapes[integrator] = body.positions()
    np.testing.assert_allclose(shapes["implicit_euler"], shapes["leapfrog"], atol=1e-3)
    assert shapes["leapfrog"][:, 2].min() < 1.2  # it hangs down


@pytest.mark.parametrize("law", ["virial", "volume_springs", "cmpm", "cmpm2"])
def test_a_hanging_bar_hangs_in_the_same_shape_as_by_leapfrog(law):
    mesh = box((0.3, 0.3, 1.2), (1, 1, 4))
    top = np.flatnonzero(mesh.vertices[:, 2] > mesh.bounds[1, 2] - 1e-6)
    material = Material(2e5, 0.2, 1000.0, 100.0, damping_ratio=0.0)
    shapes = {}
    for integrator, dt, steps in (("leapfrog", 1 / 100, 1500), ("implicit_euler", 1 / 50, 700)):
        world, body = make_world(
            mesh, material, integrator=integrator, law=law, pinned=top, position=(0, 0, 3)
        )
        for _ in range(steps):
            world.step(dt)
        assert np.abs(body.velocities()).max() < 2e-3
        shapes[integrator] = body.positions()
    np.testing.assert_allclose(shapes["implicit_euler"], shapes["leapfrog"], atol=1.2e-3)
    sag = mesh.vertices[:, 2].min() + 3 - shapes["leapfrog"][:, 2].min()
    assert sag > 0.01


def test_a_stiff_bar_takes_one_implicit_step_a_frame_and_settles():
    """E = 100 MPa at 60 Hz, where leapfrog would need hundreds of substeps."""
    mesh = box((1.5, 0.3, 0.3), (6, 2, 2))
    material = Material(1e8, 0.3, 1000.0, 100.0, damping_ratio=0.0)
    world, body = make_world(mesh, material, floor=0.0, position=(0, 0, 1.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error", SolverWarning)
        for _ in range(300):
            world.step(1 / 60)
            assert np.isfinite(body.positions()).all()
    assert not body.is_frozen
    assert np.abs(body.velocities()).max() < 0.02
    assert body.positions()[:, 2].min() == pytest.approx(0.0, abs=1e-4)
    assert np.ptp(body.positions()[:, 2]) == pytest.approx(0.3, rel=1e-3)
    explicit, _ = make_world(mesh, material, integrator="leapfrog")
    assert explicit.stable_substeps(1 / 60) > 50


def test_a_body_at_rest_is_carried_by_the_floor():
    """The floor's push is part of the solve: a block pressed by its own weight only, as by leapfrog."""
    mesh = box((0.5, 0.5, 0.5), (3, 3, 3))
    height = {}
    for integrator, dt in (("leapfrog", 1 / 120), ("implicit_euler", 1 / 60)):
        world, body = make_world(
            mesh,
            Material(1e5, 0.3, 1000.0, 50.0, damping_ratio=0.0),
            floor=0.0,
            integrator=integrator,
            position=(0, 0, 0.26),
            world={"friction": 0.0},
        )
        for _ in range(900):
            world.step(dt)
        assert body.positions()[:, 2].min() == pytest.approx(0.0, abs=1e-6)
        height[integrator] = body.positions()[:, 2].max()
    assert height["implicit_euler"] == pytest.approx(height["leapfrog"], abs=5e-4)
    # Squeezed by half of rho g H^2 / E on the whole.
    assert height["leapfrog"] == pytest.approx(0.5 - 1000 * 9.81 * 0.5**2 / 2 / 1e5, abs=2e-3)


def test_friction_stops_a_sliding_box_after_the_distance_of_coulombs_law():
    mesh = box((0.5, 0.5, 0.2), (2, 2, 1))
    world, body = make_world(
        mesh,
        Material(1e6, 0.2, 1000.0, 50.0, damping_ratio=0.0),
        floor=0.0,
        position=(0, 0, 0.1),
        velocity=(2.0, 0, 0),
        world={"friction": 0.4},
    )
    start = body.center_of_mass()[0]
    for _ in range(300):
        world.step(1 / 120)
    expected = 2.0**2 / (2 * 0.4 * 9.81)
    assert body.center_of_mass()[0] - start == pytest.approx(expected, rel=0.05)
    assert np.abs(body.velocities()).max() < 0.01


@pytest.mark.guard
def test_a_cube_on_the_floor_slides_below_the_friction_of_a_slope_and_sticks_above_it():
    """Gravity is slanted instead of the floor. The cube settles, and then has g (sin a - mu cos a)."""
    slope, mesh = 0.3, box((0.5, 0.5, 0.5), (3, 3, 3))
    gravity = 9.81 * np.array([np.sin(slope), 0.0, -np.cos(slope)])
    for share in (0.5, 0.9, 1.3):
        options = {"gravity": gravity, "friction": share * np.tan(slope)}
        world, body = make_world(
            mesh, Material(1e6, 0.2, 1000.0, 300.0), floor=0.0, position=(0, 0, 0.25), world=options
        )
        places = []
        for _ in range(3):
            for _ in range(90):
                world.step(1 / 60)
            places.append(body.center_of_mass()[0])
        expected = max(0.0, 1 - share) * gravity[0]
        assert np.diff(places, 2)[0] / 1.5**2 == pytest.approx(expected, abs=3e-3)
        assert share < 1 or places[-1] - places[0] < 1e-3


def test_a_stiff_bar_that_bends_falls_as_fast_as_a_soft_one():
    """After n steps of h, the fall is g h^2 n (n + 1) / 2.

    Products with a stiff matrix must not hide the common motion.
    """
    mesh, steps = box((4.0, 1.0, 1.0), (8, 2, 2)), 30
    for young in (1e6, 1e9):
        world, body = make_world(mesh, Material(young, 0.3, 1000.0, damping_ratio=0.0))
        bent = mesh.vertices + [0.0, 0.0, 0.1] * np.sin(2.0 * mesh.vertices[:, :1])
        body.set_motion(bent, np.zeros_like(bent))
        start = body.center_of_mass()[2]
        for _ in range(steps):
            world.step(1 / 60)
        fallen = 9.81 * steps * (steps + 1) / 2 / 60**2
        assert start - body.center_of_mass()[2] == pytest.approx(fallen, rel=1e-4)


@pytest.mark.guard
def test_momentum_is_kept_in_flight_and_ringing_fades():
    """By the system as well as by the forces; and implicit Euler takes energy where nothing damps."""
    mesh = sphere(0.5, 2)
    world, body = make_world(
        mesh, Material(1e5, 0.3, 1000.0, damping_ratio=0.0), world={"gravity": (0, 0, 0), "tolerance": 1e-5}
    )
    rng = np.random.default_rng(0)
    v = rng.normal(size=mesh.vertices.shape)
    body.set_motion(mesh.vertices, v)
    before, energy = body.momentum(), body.kinetic_energy()
    for _ in range(100):
        world.step(0.01)
    np.testing.assert_allclose(body.momentum(), before, atol=1e-3 * np.abs(before).max())
    speed = before / body.masses.sum()
    drift = 0.5 * body.masses.sum() * speed @ speed
    assert body.kinetic_energy() - drift < 0.5 * (energy - drift)


@pytest.mark.parametrize("law", ["virial", "volume_springs", "cmpm"])
def test_the_same_input_gives_the_same_bits(law):
    rows = []
    for _ in range(2):
        world = bare_world(integrator="implicit_euler")
        for i in range(2):
            world.add_body(
                sphere(0.5, 1),
                Material(1e5, 0.3, 1000.0, 5.0, damping_ratio=0.0),
                law=law,
                position=(2.0 * i, 0, 0.7),
            )
        world.build()
        for _ in range(30):
            world.step(1 / 60)
        rows.append(np.concatenate([body.positions() for body in world.bodies]).tobytes())
    assert rows[0] == rows[1]


def test_a_solve_that_stops_early_is_reported_with_its_residual_and_stays_finite():
    world, body = make_world(
        box((1, 1, 1), (4, 4, 4)),
        Material(1e8, 0.45, 1000.0, damping_ratio=0.0),
        floor=0.0,
        position=(0, 0, 0.6),
        world={"most_iterations": 2},
    )

    def fall():
        for _ in range(40):
            world.step(1 / 60)

    with pytest.warns(SolverWarning, match=r"body 0 .*residual.*0\.00\d+ .*0\.001 .*2"):
        fall()
    assert np.isfinite(body.positions()).all()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        world.step(1 / 60)  # the warning appears once


def test_a_body_that_fails_under_it_is_frozen_and_can_be_asked_why():
    """One that gravity takes past the highest speed that counts as sound."""
    world, body = make_world(sphere(0.5, 1), Material(1e5, 0.3, 1000.0, damping_ratio=0.0))
    body.set_motion(body.mesh.vertices, np.tile((0.0, 0.0, -19_999.0), (body.vertex_count, 1)))
    with pytest.warns(FrozenBodyWarning, match="body 0 went non-finite"):
        world.step(0.5)
    assert body.is_frozen
    # It lacks 1 m/s, and gains 9.81 m/s^2 * 0.5 s / 32 in each piece of the step.
    assert body.failure.substep in (None, 7)
    assert np.isfinite(body.positions()).all()


@pytest.mark.parametrize(
    ("mesh", "material"),
    [
        (rope(2.0, 10, 0.5), SpringMaterial(1e5, 1.0)),
        (cloth((1.0, 1.0), (10, 10), 0.3), SpringMaterial(4e3, 1.0)),
        (sphere(0.5, 2), SOFT),
    ],
    ids=["rope", "cloth", "ball"],
)
def test_what_spins_and_trembles_freely_keeps_its_angular_momentum_and_gains_no_energy(mesh, material):
    """For five seconds. Only the first substeps may stretch edges: their ends move along straight lines.

    At last it turns about its main axis, as fast as its angular momentum asks for.
    """
    world, body = make_world(mesh, material, world={"gravity": (0, 0, 0), "tolerance": 1e-5})
    x = body.positions().astype(float)
    random = np.random.default_rng(0).normal(size=x.shape)
    body.set_motion(x, np.cross((0, 0, 3.0), x - x.mean(axis=0)) + 0.3 * random)
    masses = body.masses.astype(float)

    def spin():
        arms = body.positions() - masses @ body.positions() / masses.sum()
        return masses @ np.cross(arms, body.velocities().astype(float))

    before, energies = spin(), []
    for _ in range(300):
        energies.append(body.kinetic_energy() + body.elastic_energy())
        world.step(1 / 60)
    np.testing.assert_allclose(spin(), before, atol=3e-3 * np.linalg.norm(before))
    assert max(energies) < 2.0 * energies[0]
    assert max(np.diff(energies[60:])) < 1e-3 * energies[0]
    common = 0.5 * (masses @ body.velocities()) @ (masses @ body.velocities()) / masses.sum()
    arms = x - masses @ x / masses.sum()
    flat = masses @ (arms[:, :2] ** 2).sum(axis=1)
    assert body.kinetic_energy() - common == pytest.approx(before @ before / 2 / flat, rel=0.05)


def test_a_rope_swings_from_a_pin_and_falls_into_line_without_substeps():
    """It starts level. Nothing but bending and stretching takes energy of the swing, until the air does."""
    world, body = make_world(
        rope(2.0, 10, 0.5), SpringMaterial(1e5, 1.0), law="springs", pinned=[0], position=(1, 0, 5)
    )
    heights, masses = [], body.masses.astype(float)
    for _ in range(300):
        world.step(1 / 60)
        speeds = body.velocities().astype(float)
        lost = masses @ (9.81 * (5.0 - body.positions()[:, 2]) - 0.5 * (speeds**2).sum(axis=1))
        heights.append(lost / masses.sum() / 9.81)
    assert heights[60] < 0.15  # of one metre
    assert min(np.diff(heights)) > -0.02
    body.set_linear_damping(1.0)
    for _ in range(900):
        world.step(1 / 60)
    x = body.positions()
    np.testing.assert_allclose(x[0], (0, 0, 5), atol=0)
    assert x[-1, 2] == pytest.approx(3.0, abs=0.01)
    assert np.abs(x[:, 0]).max() < 0.1


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"schedule": "flat"}, "'flat'.*implicit_euler"),
        ({"tolerance": 0}, "tolerance.*1e-06 to 0.5, got 0"),
        ({"tolerance": 1.0}, "tolerance"),
        ({"tolerance": "fine"}, "tolerance"),
        ({"most_iterations": 0}, "most_iterations.*whole number from 1"),
        ({"most_iterations": 1.5}, "most_iterations"),
    ],
)
def test_options_out_of_range_are_refused(options, text):
    with pytest.raises(OptionError, match=text):
        bare_world(integrator="implicit_euler", **options)


def test_one_step_a_frame_is_what_it_needs():
    world, body = make_world(sphere(0.5, 1), Material(1e9, 0.3, 1000.0, damping_ratio=0.0))
    assert world.stable_substeps(1 / 30) == 1
    world.step(1 / 30)  # warns of nothing
    assert np.isfinite(body.positions()).all()
