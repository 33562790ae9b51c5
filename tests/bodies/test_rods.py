"""Rods in a world: theory of beams and shafts, conservation laws, clamps, contact, snapshots."""

from contextlib import nullcontext

import numpy as np
import pytest
import trimesh

from taichi_soft import (
    BoxShape,
    CapsuleShape,
    FrozenBodyWarning,
    MaterialError,
    MeshError,
    MeshShape,
    OptionError,
    Plasticity,
    RodMaterial,
    RodMesh,
    SoftBodyAsset,
    UnstableStepWarning,
    box,
    rod,
)
from taichi_soft.world.bare import bare_world

YOUNG, POISSON, DENSITY, RADIUS, LENGTH, EDGES = 1e7, 0.3, 1000.0, 0.01, 1.0, 20
RUBBER = RodMaterial(YOUNG, POISSON, DENSITY, RADIUS)
AREA, SECOND = np.pi * RADIUS**2, np.pi / 4 * RADIUS**4
SHEAR, POLAR = YOUNG / (2 * (1 + POISSON)), np.pi / 2 * RADIUS**4
CLAMPED_EDGE = LENGTH / EDGES
CUBE = box((0.1, 0.1, 0.1), (1, 1, 1))


def about_x(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def coil(turns=5, diameter=0.1, pitch=0.012, per_turn=24):
    turn = np.linspace(0.0, 2 * np.pi * turns, turns * per_turn + 1)
    x, y = diameter / 2 * np.cos(turn), diameter / 2 * np.sin(turn)
    return RodMesh(np.stack([x, y, pitch * turn / (2 * np.pi)], axis=1))


def floating(mesh, material, **options):
    world = bare_world(floor=None, gravity=(0, 0, 0))
    body = world.add_body(mesh, material, **options)
    world.build()
    return world, body


def twisted(angle, material=RUBBER, seconds=1.0):
    """A straight rod, clamped at both ends by frames; the right one has turned by `angle`.

    Returns: the world, the body, the two attachments, and the length between the middles of clamped edges.
    """
    world = bare_world(floor=None, gravity=(0, 0, 0))
    body = world.add_body(rod(LENGTH, EDGES), material)
    left, right = world.add_frame(), world.add_frame()
    world.build()
    held = body.attach([0, 1], left), body.attach([EDGES - 1, EDGES], right, two_way=True)
    body.set_linear_damping(30.0)
    steps = int(60 * seconds)
    for step in range(steps):
        right.move_to((0, 0, 0), about_x(angle * (step + 1) / steps))
        world.step(1 / 60)
    for _ in range(30):
        world.step(1 / 60)
    body.set_linear_damping(0.0)
    return world, body, held, LENGTH - CLAMPED_EDGE


def test_a_clamped_rod_sags_under_a_weight_at_its_end_as_beam_theory_says():
    """w = F L^3 / (3 E I), from the middle of the clamped edge."""
    world, body = floating(rod(LENGTH, EDGES), RUBBER, pinned=[0, 1])
    body.set_linear_damping(4.0)
    force, length = 2e-3, LENGTH - CLAMPED_EDGE / 2
    for _ in range(300):
        body.apply_force((0, 0, -force), [EDGES])
        world.step(1 / 60)
    expected = force * length**3 / (3 * YOUNG * SECOND)
    assert -body.positions()[-1, 2] == pytest.approx(expected, rel=0.02)
    assert body.elastic_energy() == pytest.approx(force * expected / 2, rel=0.03)


def test_a_clamped_hose_swings_with_the_frequency_of_a_beam():
    """w1 = 3.516 sqrt(E I / (rho A L^4)) with the area and second moment of a tube."""
    inner = 0.8 * RADIUS
    tube = RodMaterial(YOUNG, POISSON, DENSITY, RADIUS, inner)
    world, body = floating(rod(LENGTH, EDGES), tube, pinned=[0, 1])
    body.set_linear_damping(4.0)
    for _ in range(120):
        body.apply_force((0, 0, -1e-3), [EDGES])
        world.step(1 / 60)
    body.set_linear_damping(0.0)
    dt, heights = 1 / 240, []
    for _ in range(720):
        world.step(dt)
        heights.append(float(body.positions()[-1, 2]))
    h = np.array(heights)
    turns = np.flatnonzero(np.sign(h[1:]) != np.sign(h[:-1]))
    crossings = (turns + h[turns] / (h[turns] - h[turns + 1])) * dt
    length = LENGTH - CLAMPED_EDGE / 2
    ratio = (RADIUS**2 + inner**2) / 4  # I / A
    expected = 3.516 * np.sqrt(YOUNG * ratio / (DENSITY * length**4))
    assert np.pi / np.diff(crossings).mean() == pytest.approx(expected, rel=0.02)


def test_a_twisted_shaft_has_the_energy_and_the_frequency_of_torsion():
    """M = G J theta / L, E = M theta / 2. Released at one end, it swings with waves of sqrt(G / rho)."""
    angle = 2.5
    world, body, (_, right), length = twisted(angle)
    assert body.elastic_energy() == pytest.approx(SHEAR * POLAR * angle**2 / (2 * length), rel=2e-3)
    assert right.torque == pytest.approx((-SHEAR * POLAR * angle / length, 0, 0), rel=2e-3, abs=1e-6)
    assert np.abs(body.positions()[:, 1:]).max() < 1e-6
    right.release()
    energies = []
    for _ in range(400):
        world.step(1 / 2000)
        energies.append(body.elastic_energy())
    e = np.array(energies)
    lowest = np.flatnonzero((e[1:-1] < e[:-2]) & (e[1:-1] <= e[2:])) / 2000
    between_lowest = 2 * (LENGTH - CLAMPED_EDGE / 2) / np.sqrt(SHEAR / DENSITY)
    assert np.diff(lowest).mean() == pytest.approx(between_lowest, rel=0.01)
    assert body.elastic_energy() + body.kinetic_energy() == pytest.approx(e.max(), rel=0.02)


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_a_twisted_shaft_leaves_its_axis_at_the_moment_of_greenhill(share):
    """A shaft with clamped ends buckles at the moment 8.987 E I / L (Greenhill 1883)."""
    damped = RodMaterial(YOUNG, POISSON, DENSITY, RADIUS, bending_damping=1e-3)
    critical = 8.987 * YOUNG * SECOND / (SHEAR * POLAR)
    world, body, _, _ = twisted(share * critical, damped)
    body.apply_impulse((0, 1e-4, 0), [EDGES // 3])
    for _ in range(180):
        world.step(1 / 60)
    distance = np.abs(body.positions()[:, 1:]).max()
    assert distance > 2.5e-3 if share > 1 else distance < 1e-3


def test_a_coil_spring_has_the_stiffness_of_theory():
    """k = G d^4 / (8 D^3 n) for n turns of a wire of diameter d."""
    wire, diameter, turns, pull = 0.006, 0.1, 5, 0.01
    mesh = coil(turns, diameter)
    world = bare_world(floor=None, gravity=(0, 0, 0))
    body = world.add_body(mesh, RodMaterial(1e8, 0.3, 1000, wire / 2), pinned=[0, 1])
    frame = world.add_frame()
    world.build()
    last = len(mesh.vertices) - 1
    held = body.attach([last - 1, last], frame, two_way=True)
    body.set_linear_damping(10.0)
    for step in range(60):
        frame.move_to((0, 0, pull * min(1.0, (step + 1) / 20)))
        world.step(1 / 60)
    free_turns = turns - 1 / 24
    expected = 1e8 / 2.6 * wire**4 / (8 * diameter**3 * free_turns)
    assert -held.force[2] / pull == pytest.approx(expected, rel=0.05)


def test_a_tumbling_twisted_rod_keeps_momentum_angular_momentum_and_energy():
    world, body, held, _ = twisted(6.0)
    for each in held:
        each.release()
    torsion = body.elastic_energy()
    body.set_velocity((0, 0, 0), (3.0, 4.0, 5.0))
    rng = np.random.default_rng(0)
    impulses = rng.normal(0, 1e-3, (EDGES + 1, 3))
    for vertex, impulse in enumerate(impulses - impulses.mean(axis=0)):
        body.apply_impulse(impulse, [vertex])
    spin, energy = body.angular_momentum(), body.kinetic_energy() + body.elastic_energy()
    assert torsion > 0.1 * energy
    scale = float((body.masses * np.linalg.norm(body.velocities(), axis=1)).sum())
    energies = []
    for _ in range(60):
        world.step(1 / 60)
        assert np.abs(body.momentum()).max() < 1e-5 * scale
        assert np.abs(body.angular_momentum() - spin).max() < 1e-4 * np.linalg.norm(spin)
        energies.append(body.kinetic_energy() + body.elastic_energy())
    # The spin is half a substep earlier than the positions, which makes the sum swing.
    assert np.abs(np.array(energies) / energy - 1).max() < 0.06
    assert np.mean(energies) == pytest.approx(energy, rel=0.01)
    assert np.abs(body.positions()[:, 1:]).max() > 0.02


@pytest.mark.parametrize("mesh", [rod(LENGTH, EDGES), coil(2)], ids=["straight", "coil"])
def test_the_stable_substep_is_the_limit_of_stability(mesh):
    for constants in ({}, {"damping": 0.1}, {"bending_damping": 5e-3}, {"torsion_damping": 1e-3}):
        world = bare_world(floor=None, gravity=(0, 0, 0), retries=0)
        body = world.add_body(mesh, RodMaterial(YOUNG, POISSON, DENSITY, RADIUS, **constants))
        world.build()
        limit, speeds = body.stable_step.limit, []
        for share in (0.99, 1.2):
            rng = np.random.default_rng(1)
            body.set_motion(mesh.vertices, rng.normal(0, 1e-4, mesh.vertices.shape))
            with pytest.warns(UnstableStepWarning) if share > 1 else nullcontext():
                world.step(300 * share * limit, 300)
            speeds.append(np.inf if body.is_frozen else float(np.abs(body.velocities()).max()))
        assert speeds[0] < 1e-2 < speeds[1]
        if constants:
            assert body.stable_step.limit < body.stable_step.undamped


def test_a_rod_at_rest_stays_at_rest_wherever_it_is_placed():
    mesh = coil(2)
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    damped = RodMaterial(YOUNG, POISSON, DENSITY, RADIUS, damping=0.2, bending_damping=1e-4)
    world, body = floating(mesh, damped, position=(0.1, 0.2, 0.3), rotation=turn)
    bent = mesh.vertices * (1.0, 1.0, 2.0)  # for the size of an energy that matters
    body.set_motion(bent, np.zeros_like(bent))
    large = body.elastic_energy()
    assert large > 1e-4
    placed = mesh.vertices @ turn.T + (0.1, 0.2, 0.3)
    body.set_motion(placed, np.zeros_like(placed))
    assert body.elastic_energy() < 1e-6 * large
    body.teleport((0.2, 0.3, 0.4), rotation=turn @ turn)
    assert body.elastic_energy() < 1e-6 * large
    for _ in range(60):
        world.step(1 / 60)
    assert body.elastic_energy() < 1e-5 * large
    assert np.abs(body.velocities()).max() < 3e-3


def test_a_rotating_coil_spins_as_a_whole_from_the_first_step():
    """A rigid rotation without the spin of the edges would start waves of torsion."""
    mesh, angular = coil(2), np.array((0.0, 0.0, 20.0))
    asset = SoftBodyAsset(mesh, RUBBER)
    world = bare_world(floor=None, gravity=(0, 0, 0))
    world.reserve(asset, 1)
    world.build()
    body = world.spawn(asset, angular_velocity=angular)
    arms = mesh.vertices - body.center_of_mass()
    orbit = np.cross(arms, np.cross(angular, arms)) * body.masses[:, None]
    along = np.diff(mesh.vertices, axis=0)
    lengths = np.linalg.norm(along, axis=1)
    inertia = DENSITY * POLAR * lengths
    t = along / lengths[:, None]
    expected = orbit.sum(axis=0) + (inertia * (t @ angular)) @ t
    assert np.abs(body.angular_momentum() - expected).max() < 1e-4 * np.linalg.norm(expected)
    body.set_velocity((0, 0, 0), angular)
    assert np.abs(body.angular_momentum() - expected).max() < 1e-4 * np.linalg.norm(expected)


def test_another_material_acts_at_once_and_keeps_the_torsion():
    angle = 2.0
    world, body, _, length = twisted(angle)
    body.set_material(RodMaterial(YOUNG / 4, POISSON, DENSITY, RADIUS))
    world.step(1 / 60)
    assert body.elastic_energy() == pytest.approx(SHEAR / 4 * POLAR * angle**2 / (2 * length), rel=0.01)
    body.set_material(RodMaterial(YOUNG / 2, POISSON, DENSITY, RADIUS))
    body.set_linear_damping(10.0)
    for _ in range(90):
        world.step(1 / 60)
    assert body.elastic_energy() == pytest.approx(SHEAR / 2 * POLAR * angle**2 / (2 * length), rel=0.01)


def test_a_snapshot_continues_a_twisted_rod_with_the_same_bits():
    world, body, (_, right), _ = twisted(9.0)
    right.release()
    world.step(1 / 60)
    saved = world.snapshot()
    runs = []
    for _ in range(2):
        for _ in range(20):
            world.step(1 / 60)
        runs.append((body.positions().tobytes(), body.elastic_energy(), body.kinetic_energy()))
        world.restore(saved)
    assert runs[0] == runs[1]


def test_a_step_that_is_retried_starts_with_the_torsion_from_before():
    """Attempts with 8 to 32 substeps fail, and the one with 64 gives the bits of a step with 64 at once."""
    results = []
    for substeps in (8, 64):
        world, body, (_, right), _ = twisted(9.0)
        right.release()
        body.apply_impulse((0, 0.02, 0), [EDGES])
        with pytest.warns(UnstableStepWarning) if substeps == 8 else nullcontext():
            world.step(1 / 60, substeps)
        assert not body.is_frozen
        results.append((body.positions().tobytes(), body.elastic_energy(), body.kinetic_energy()))
    assert results[0] == results[1]


def test_a_rod_that_fails_names_the_edge():
    world = bare_world(floor=None, gravity=(0, 0, 0), retries=0)
    body = world.add_body(rod(LENGTH, EDGES), RUBBER)
    world.build()
    x = body.mesh.vertices.copy()
    x[7] += (0, 0, 1e4)
    body.set_motion(x, np.zeros_like(x))
    with pytest.warns(FrozenBodyWarning):
        world.step(1 / 6)
    assert body.failure.edge is not None
    assert abs(body.failure.edge[0] - 7) <= 2


def test_pooled_rods_start_without_the_torsion_of_the_one_before():
    asset = SoftBodyAsset(coil(2), RUBBER)
    world = bare_world(floor=None, gravity=(0, 0, 0))
    world.reserve(asset, 1)
    frame = world.add_frame()
    world.build()
    first = world.spawn(asset)
    first.attach([0, 1], frame)
    for step in range(30):
        frame.move_to((0, 0, 0), about_x(0.1 * (step + 1)))
        world.step(1 / 60)
    assert first.elastic_energy() > 1e-3
    world.despawn(first)
    second = world.spawn(asset, position=(1, 0, 0))
    assert second.elastic_energy() < 1e-7
    assert second.kinetic_energy() == 0.0


@pytest.mark.soak
@pytest.mark.parametrize("shape", ["box", "capsule", "mesh"])
def test_a_hose_over_a_collider_and_on_the_floor_stays_a_radius_away_from_both(shape):
    """The distance of points on the axis from a box, from an axis of a capsule, by closed forms."""
    half, radius = np.array([0.2, 0.2, 0.1]), 0.02
    block = trimesh.creation.box(2 * half)
    made = {"box": BoxShape(2 * half), "capsule": CapsuleShape(0.1, 0.4), "mesh": MeshShape(block, cell=0.02)}
    world = bare_world(floor=0.0, collider_room=1, soft_contact=True)
    turn = [[1, 0, 0], [0, 0, 1], [0, -1, 0]] if shape == "capsule" else np.eye(3)
    world.add_collider(made[shape], position=(0, 0, 0.1), rotation=turn)
    hose = world.add_body(
        rod(1.2, 24), RodMaterial(3e5, 0.4, 1000.0, radius, damping=0.2), position=(0, 0, 0.3)
    )
    other = world.add_body(rod(0.5, 10), RUBBER, position=(0, 1, 0), on_floor=True)
    world.build()
    assert other.positions()[:, 2] == pytest.approx(RADIUS, abs=1e-6)
    for _ in range(180):
        world.step(1 / 60)
        x = hose.positions().astype(float)
        t = np.linspace(0, 1, 9)[:, None, None]
        x = ((1 - t) * x[:-1] + t * x[1:]).reshape(-1, 3) - (0, 0, 0.1)
        outside = np.maximum(np.abs(x) - half, 0.0)
        gap = np.linalg.norm(outside, axis=1)
        if shape == "capsule":
            gap = np.linalg.norm(x - np.clip(x[:, 1:2], -0.2, 0.2) * (0, 1, 0), axis=1) - 0.1
        assert gap.min() > radius - (4e-3 if shape == "mesh" else 1e-3)
        assert x[:, 2].min() > radius - 0.1 - 1e-3
    assert other.positions()[:, 2] == pytest.approx(RADIUS, abs=1e-4)
    assert gap.min() < radius + 1e-3


@pytest.mark.soak
def test_a_cable_lies_across_another_one_at_the_sum_of_their_radii():
    thick, thin = RodMaterial(1e6, 0.3, 1000, 0.02), RodMaterial(1e6, 0.3, 1000, 0.01, bending_damping=0.02)
    world = bare_world(floor=None, soft_contact=True)
    mesh = rod(0.6, 12)
    lower = world.add_body(mesh, thick, pinned=range(13))
    upper = world.add_body(mesh, thin, position=(0, 0, 0.035), rotation=[[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    world.build()
    upper.set_linear_damping(5.0)
    for _ in range(60):
        world.step(1 / 60)
    assert np.abs(lower.positions()[:, 2]).max() < 1e-6
    assert upper.positions()[6, 2] == pytest.approx(0.03, abs=2e-3)
    assert upper.positions()[0, 2] < 0.02


@pytest.mark.numpy
@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"spare_vertices": 5}, OptionError, "law 'rod' does not support spare_vertices"),
        ({"plasticity": Plasticity(yield_stress=1e3)}, OptionError, "law 'rod' does not support plasticity"),
        ({"hull": (CUBE.vertices, CUBE.surface)}, MeshError, "RodMesh.* does not support hulls"),
        ({"skin": (CUBE.vertices, CUBE.surface)}, MeshError, "RodMesh.* does not support skins"),
        ({"law": "springs"}, MaterialError, "law 'springs' does not support a RodMaterial"),
        ({"damping_model": "tet_mean"}, OptionError, "law 'rod' has no damping_model"),
    ],
)
def test_options_of_an_asset_that_a_rod_does_not_support_are_refused(options, error, message):
    with pytest.raises(error, match=message):
        SoftBodyAsset(rod(1, 4), RUBBER, **options)


def test_levels_and_cuts_of_a_rod_are_refused():
    coarse = SoftBodyAsset(rod(1, 2), RUBBER)
    with pytest.raises(OptionError, match="law 'rod' has no levels of detail"):
        SoftBodyAsset(rod(1, 4), RUBBER, coarser=(coarse,))
    world, body = floating(rod(LENGTH, EDGES), RUBBER)
    with pytest.raises(OptionError, match="spare_vertices"):
        body.cut(plane=((0, 0, 0), (1, 0, 0)))
    world.step(1 / 60)
    assert body.elastic_energy() < 1e-9


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"schedule": "flat"}, "schedule 'flat' does not support rods"),
        ({"integrator": "implicit_euler"}, "integrator 'implicit_euler' does not support rods"),
        ({"integrator": "explicit_euler"}, "does not support rods"),
    ],
)
def test_what_a_rod_does_not_support_is_refused(options, message):
    world = bare_world(**options)
    world.add_body(rod(1, 2), RUBBER)
    with pytest.raises(OptionError, match=message):
        world.build()
