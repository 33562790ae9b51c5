"""Shells in a world: beam theory, conservation laws, contact, snapshots, changes of material."""

import numpy as np
import pytest

from taichi_soft import (
    BoxShape,
    Contact,
    FrozenBodyWarning,
    Material,
    OptionError,
    ShellMaterial,
    ShellMesh,
    UnstableStepWarning,
    box,
    sheet,
)
from taichi_soft.world.bare import bare_world

YOUNG, DENSITY, THICKNESS, LENGTH = 1e8, 1000.0, 0.01, 0.5
STEEL_LIKE = ShellMaterial(YOUNG, 0.0, DENSITY, THICKNESS)
CELLS = 20
DOME = ShellMaterial(2e6, 0.3, 500, 4e-3)


def dome():
    """Part of a sphere, which is curved in both directions at rest."""
    flat = sheet((0.8, 0.8), (8, 8))
    x = flat.vertices.copy()
    x[:, 2] = np.sqrt(0.7**2 - (x[:, :2] ** 2).sum(axis=1)) - 0.6
    return ShellMesh(x, flat.triangles)


def clamped_strip(material, gravity, unevenness=0.0):
    """A strip along x, whose first two rows are pinned. The clamp lies between these rows.

    Inner vertices are moved by up to `unevenness` cells.
    """
    mesh = sheet((LENGTH, 0.1), (CELLS, 4))
    rest = mesh.vertices.copy()
    is_inner = (np.abs(rest[:, 1]) < 0.049) & (
        np.abs(rest[:, 0] - LENGTH / CELLS) < LENGTH / 2 - 1.5 * LENGTH / CELLS
    )
    moves = np.random.default_rng(0).uniform(-unevenness, unevenness, (is_inner.sum(), 2)) * LENGTH / CELLS
    rest[is_inner, :2] += moves
    mesh = ShellMesh(rest, mesh.triangles)
    world = bare_world(floor=None, gravity=(0, 0, -gravity))
    x = mesh.vertices[:, 0]
    body = world.add_body(mesh, material, pinned=np.flatnonzero(x < -LENGTH / 2 + 1.01 * LENGTH / CELLS))
    world.build()
    return world, body, np.flatnonzero(x > LENGTH / 2 - 1e-6), LENGTH * (1 - 0.5 / CELLS)


@pytest.mark.parametrize(("unevenness", "least"), [(0.0, 0.99), (0.2, 0.92)])
def test_a_clamped_strip_sags_as_beam_theory_says(unevenness, least):
    """w = rho g A L^4 / (8 E I). Uneven triangles are a little too stiff."""
    world, body, tip, length = clamped_strip(STEEL_LIKE, 1.0, unevenness)
    body.set_linear_damping(25.0)
    for _ in range(120):
        world.step(1 / 60)
    expected = DENSITY * THICKNESS * length**4 / (8 * YOUNG * THICKNESS**3 / 12)
    assert least < -body.positions()[tip, 2].mean() / expected < 1.01


def test_a_clamped_strip_swings_with_the_frequency_of_a_beam():
    """w1 = 3.516 sqrt(E I / (rho A L^4)). The strip is released from its static shape without gravity."""
    world, body, tip, length = clamped_strip(STEEL_LIKE, 1.0)
    body.set_linear_damping(25.0)
    for _ in range(120):
        world.step(1 / 60)
    body.set_linear_damping(0.0)
    world.set_gravity((0, 0, 0))
    dt, heights = 1 / 240, []
    for _ in range(480):
        world.step(dt)
        heights.append(float(body.positions()[tip, 2].mean()))
    sign = np.sign(heights)
    turns = np.flatnonzero(sign[1:] != sign[:-1])
    h = np.array(heights)
    crossings = (turns + h[turns] / (h[turns] - h[turns + 1])) * dt
    frequency = np.pi / np.diff(crossings).mean()
    expected = 3.516 * np.sqrt(YOUNG * THICKNESS**2 / (12 * DENSITY * length**4))
    assert frequency == pytest.approx(expected, rel=0.01)


def test_damping_of_bending_has_the_ratio_that_the_frequency_gives():
    """An amplitude decays with the rate tau w^2 / 2."""
    tau = 1e-3
    damped = ShellMaterial(YOUNG, 0.0, DENSITY, THICKNESS, bending_damping=tau)
    world, body, tip, length = clamped_strip(damped, 1.0)
    body.set_linear_damping(25.0)
    for _ in range(120):
        world.step(1 / 60)
    body.set_linear_damping(0.0)
    world.set_gravity((0, 0, 0))
    heights = []
    for _ in range(480):
        world.step(1 / 240)
        heights.append(float(body.positions()[tip, 2].mean()))
    h = np.abs(heights)
    peaks = np.flatnonzero((h[1:-1] > h[:-2]) & (h[1:-1] >= h[2:])) + 1
    rate = -np.polyfit(peaks / 240, np.log(h[peaks]), 1)[0]
    frequency = 3.516 * np.sqrt(YOUNG * THICKNESS**2 / (12 * DENSITY * length**4))
    assert rate == pytest.approx(tau * frequency**2 / 2, rel=0.05)


def test_a_hanging_strip_stretches_under_its_own_weight():
    """The lower end sinks by rho g L^2 / (2 E)."""
    mesh = sheet((0.1, 1.0), (2, 20))
    soft = ShellMaterial(2e5, 0.0, 500, 2e-3)
    world = bare_world(floor=None)
    top = np.flatnonzero(mesh.vertices[:, 1] > 0.49)
    body = world.add_body(mesh, soft, pinned=top, rotation=[[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    world.build()
    body.set_linear_damping(30.0)
    for _ in range(120):
        world.step(1 / 60)
    expected = 500 * 9.81 / (2 * 2e5)
    assert -0.5 - body.positions()[:, 2].min() == pytest.approx(
        expected, rel=0.03
    )  # Green's strain: 1.5 strain


@pytest.mark.parametrize("mesh", [sheet((0.8, 0.8), (8, 8)), dome()], ids=["flat", "curved"])
def test_a_free_shell_at_rest_keeps_its_shape(mesh):
    world = bare_world(floor=None, gravity=(0, 0, 0))
    body = world.add_body(mesh, DOME)
    world.build()
    for _ in range(60):
        world.step(1 / 60)
    assert np.abs(body.positions() - mesh.vertices).max() < 1e-5


def test_a_tumbling_shell_keeps_momentum_angular_momentum_and_energy():
    mesh = dome()
    world = bare_world(floor=None, gravity=(0, 0, 0))
    body = world.add_body(mesh, DOME)
    world.build()
    rng = np.random.default_rng(0)
    velocities = np.cross((2.0, 1.0, 3.0), mesh.vertices) + rng.normal(0, 0.2, mesh.vertices.shape)
    velocities -= body.masses @ velocities / body.masses.sum()
    body.set_motion(mesh.vertices, velocities)
    spin, energy = body.angular_momentum(), body.kinetic_energy() + body.elastic_energy()
    scale = float((body.masses * np.linalg.norm(velocities, axis=1)).sum())
    for _ in range(60):
        world.step(1 / 60)
        assert np.abs(body.masses @ body.velocities().astype(float)).max() < 1e-5 * scale
        assert np.abs(body.angular_momentum() - spin).max() < 2e-4 * np.linalg.norm(spin)
        assert body.kinetic_energy() + body.elastic_energy() == pytest.approx(energy, rel=0.02)
    assert np.ptp(body.positions(), axis=0).min() > 0.1


@pytest.mark.parametrize("mesh", [sheet((0.8, 0.8), (8, 8)), dome()], ids=["flat", "curved"])
def test_the_stable_substep_is_the_limit_of_stability(mesh):
    for constants in ({}, {"damping": 0.3}, {"bending_damping": 1.0}):
        material = ShellMaterial(2e6, 0.3, 500, 4e-3, **constants)
        world = bare_world(floor=None, gravity=(0, 0, 0), retries=0)
        body = world.add_body(mesh, material)
        world.build()
        limit = body.stable_step.limit
        speeds = []
        for share in (0.99, 1.2):
            rng = np.random.default_rng(1)
            body.set_motion(mesh.vertices, rng.normal(0, 1e-4, mesh.vertices.shape))
            with pytest.warns(UnstableStepWarning) if share > 1 else _nothing():
                world.step(300 * share * limit, 300)
            speeds.append(np.inf if body.is_frozen else float(np.abs(body.velocities()).max()))
        assert speeds[0] < 1e-2 < speeds[1]
        if constants:
            assert body.stable_step.limit < body.stable_step.undamped


def _nothing():
    from contextlib import nullcontext

    return nullcontext()


def test_a_shell_crushed_to_a_crumple_of_flipped_triangles_recovers():
    mesh = sheet((0.8, 0.8), (8, 8))
    world = bare_world(floor=None, gravity=(0, 0, 0))
    body = world.add_body(mesh, ShellMaterial(1e5, 0.3, 500, 4e-3, damping=0.5, bending_damping=5e-3))
    world.build()
    crushed = mesh.vertices * (0.05, 1.0, 1.0) + np.random.default_rng(3).normal(0, 0.02, mesh.vertices.shape)
    body.set_motion(crushed, np.zeros_like(crushed))
    for _ in range(240):
        world.step(1 / 60)
    assert not body.is_frozen
    x = body.positions()
    lengths = np.linalg.norm(x[mesh.edges[:, 1]] - x[mesh.edges[:, 0]], axis=1)
    assert np.abs(lengths / mesh.edge_lengths - 1).max() < 0.02


@pytest.mark.soak
def test_a_sheet_lies_on_the_floor_and_another_one_on_it_at_its_thickness():
    mesh = sheet((0.6, 0.3), (12, 6))
    world = bare_world(soft_contact=True)
    linen = ShellMaterial(1e6, 0.3, 400, 1e-3, damping=0.02, bending_damping=2e-3)
    lower = world.add_body(mesh, linen, position=(0, 0, 0.02))
    upper = world.add_body(mesh, linen, position=(0.02, 0.01, 0.06))
    assert lower.asset.surface_row[1] == pytest.approx(1e-3)
    world.build()
    for _ in range(120):
        world.step(1 / 60)
    assert np.abs(lower.positions()[:, 2]).max() < 5e-4
    assert np.median(upper.positions()[:, 2]) == pytest.approx(1e-3, abs=4e-4)


@pytest.mark.soak
def test_a_cloth_hangs_over_a_box_and_does_not_pass_through_itself():
    mesh = sheet((1.0, 1.0), (16, 16))
    world = bare_world(collider_room=1, soft_contact=True)
    world.add_collider(BoxShape((0.4, 0.4, 0.4)), position=(0, 0, 0.2))
    linen = ShellMaterial(2e6, 0.3, 400, 1e-3, damping=0.02, bending_damping=2e-3)
    body = world.add_body(mesh, linen, position=(0, 0, 0.45), contact=Contact(itself=True, thickness=4e-3))
    world.build()
    for _ in range(120):
        world.step(1 / 60)
    x = body.positions()
    inside = np.maximum(np.abs(x[:, :2]).max(axis=1) - 0.2, x[:, 2] - 0.4)
    assert inside.min() > -2e-3
    on_top = np.abs(x[:, :2]).max(axis=1) < 0.19
    assert 0.4 < np.median(x[on_top, 2]) < 0.404
    assert x[:, 2].max() < 0.4 + 1 / 64  # folds are lower than a quarter of an edge
    assert np.abs(x[:, 2]).min() < 0.25


@pytest.mark.soak
def test_a_grab_lifts_a_sheet_and_a_joint_carries_a_box_on_it():
    mesh = sheet((0.6, 0.6), (8, 8))
    world = bare_world(soft_contact=True)
    linen = ShellMaterial(1e6, 0.3, 500, 1e-3, damping=0.05, bending_damping=2e-3)
    body = world.add_body(mesh, linen, position=(0, 0, 1.0))
    load = world.add_body(box((0.1, 0.1, 0.1), (1, 1, 1)), Material(1e5, 0.3, 300), position=(0, 0, 0.945))
    world.build()
    middle = int(np.linalg.norm(mesh.vertices, axis=1).argmin())
    near = np.flatnonzero(np.linalg.norm(mesh.vertices, axis=1) < 0.08)
    body.attach_to(load, near)
    triangle = int(np.flatnonzero((mesh.surface == middle).any(axis=1))[0])
    grab = body.grab(triangle)
    grab.move((0.0, 0.0, 1.2))
    for _ in range(120):
        world.step(1 / 60)
    assert not body.is_frozen
    assert body.positions()[middle, 2] == pytest.approx(1.2, abs=0.1)
    assert load.center_of_mass()[2] > 0.9
    assert grab.force[2] == pytest.approx(9.81 * (body.masses.sum() + load.masses.sum()), rel=0.3)


def test_wind_carries_a_sheet_at_the_speed_of_the_air():
    mesh = sheet((0.6, 0.6), (6, 6))
    world = bare_world(floor=None, gravity=(0, 0, 0))
    body = world.add_body(mesh, ShellMaterial(1e6, 0.3, 100, 1e-3, bending_damping=2e-3))
    world.build()
    world.set_wind((0.0, 0.0, 5.0))
    for _ in range(240):
        world.step(1 / 60)
    assert 4.0 < body.velocities()[:, 2].mean() <= 5.0


def test_a_snapshot_continues_with_the_same_bits():
    mesh = dome()
    world = bare_world()
    body = world.add_body(
        mesh, ShellMaterial(1e6, 0.3, 500, 4e-3, bending_damping=1e-3), position=(0, 0, 0.5)
    )
    world.build()
    for _ in range(20):
        world.step(1 / 60)
    saved = world.snapshot()
    runs = []
    for _ in range(2):
        for _ in range(20):
            world.step(1 / 60)
        runs.append(body.positions().tobytes())
        world.restore(saved)
    assert runs[0] == runs[1]


def test_another_material_acts_at_once_or_gradually_and_adds_no_energy():
    mesh = sheet((0.1, 1.0), (2, 20))
    world = bare_world(floor=None)
    top = np.flatnonzero(mesh.vertices[:, 1] > 0.49)
    body = world.add_body(
        mesh, ShellMaterial(1e5, 0.0, 500, 2e-3), pinned=top, rotation=[[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    )
    world.build()
    body.set_linear_damping(20.0)
    for _ in range(120):
        world.step(1 / 60)
    soft = -0.5 - body.positions()[:, 2].min()
    body.set_linear_damping(0.0)
    body.set_material(ShellMaterial(2e5, 0.0, 500, 2e-3))
    highest = -np.inf
    for _ in range(90):
        world.step(1 / 60)
        highest = max(highest, float(body.positions()[:, 2].min()))
    assert -0.5 - body.positions()[:, 2].min() == pytest.approx(soft / 2, rel=0.15)
    assert highest < -0.5 - 0.35 * soft
    assert body.masses.sum() == pytest.approx(0.1)


def test_a_shell_that_fails_names_the_triangle():
    mesh = sheet((0.4, 0.4), (4, 4))
    world = bare_world(floor=None, gravity=(0, 0, 0), retries=0)
    body = world.add_body(mesh, DOME)
    world.build()
    x = mesh.vertices.copy()
    x[12] += (0, 0, 1e4)
    body.set_motion(x, np.zeros_like(x))
    with pytest.warns(FrozenBodyWarning):
        world.step(1 / 6)
    assert body.failure.triangle is not None
    assert body.failure.tetrahedron is None


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"schedule": "flat"}, "schedule 'flat' does not support shells"),
        ({"integrator": "implicit_euler"}, "integrator 'implicit_euler' does not support shells"),
        ({"integrator": "explicit_euler"}, "does not support shells"),
    ],
)
def test_what_a_shell_does_not_support_is_refused(options, message):
    world = bare_world(**options)
    world.add_body(sheet((1, 1), (2, 2)), DOME)
    with pytest.raises(OptionError, match=message):
        world.build()
