"""Levels of detail: cages of several sizes for one body, and changes of level during motion."""

from functools import cache

import numpy as np
import pytest
import trimesh
from mode_oracle import assembled_stiffness, lumped_masses
from scipy.sparse import csc_matrix, diags
from scipy.sparse.linalg import eigsh

from taichi_soft import (
    FrozenBodyWarning,
    Material,
    MaterialError,
    MeshError,
    OptionError,
    SoftBodyAsset,
    StateError,
    box,
    rope,
    sphere,
)
from taichi_soft.world.bare import bare_world

RUBBER = Material(young=8e4, poisson=0.4, density=900.0)
RING = trimesh.creation.torus(0.5, 0.2)
BAR = [box((1.2, 0.3, 0.25), cells) for cells in ((16, 4, 4), (8, 3, 2), (5, 2, 2))]
DT = 1 / 60


@cache
def ring():
    """Return a ring with three levels. It is made once, and not while tests are only collected."""
    return SoftBodyAsset.from_surface(RING, RUBBER, cells=(9, 6, 4))


@cache
def bar():
    return SoftBodyAsset(BAR[0], RUBBER).with_coarser(*BAR[1:])


def frequencies(mesh, young, density, count):
    """Return the lowest frequencies of a free body except rigid motions, by SciPy [Hz]."""
    root = np.repeat(np.sqrt(lumped_masses(mesh, density)), 3)
    K = csc_matrix(
        diags(1 / root) @ csc_matrix(assembled_stiffness(mesh, young, RUBBER.poisson)) @ diags(1 / root)
    )
    shift = 1e-3 * K.diagonal().min()
    values = eigsh(K + shift * csc_matrix(np.eye(len(root))), k=6 + count, sigma=0.0)[0]
    return np.sqrt(np.sort(values)[6:] - shift) / (2 * np.pi)


def inertia(body_or_mesh, masses, x):
    center = masses @ x / masses.sum()
    arms = x - center
    return center, (masses * (arms**2).sum(axis=1)).sum() * np.eye(3) - (masses[:, None] * arms).T @ arms


def test_coarser_bars_have_the_mass_and_the_lowest_frequencies_of_the_finest():
    """Others are faster: linear tetrahedra are stiff in bending."""
    asset = bar()
    wanted = frequencies(BAR[0], RUBBER.young, RUBBER.density, 4)
    for mesh, level in zip(BAR[1:], asset.coarser, strict=True):
        made_of = level.material
        assert level.description.masses.sum() == pytest.approx(asset.description.masses.sum(), rel=1e-9)
        young = np.asarray(made_of.young)
        density = float(np.mean(made_of.density))
        found = frequencies(mesh, young, density, 4)
        assert found == pytest.approx(wanted, rel=0.05)
        assert abs(frequencies(mesh, RUBBER.young, RUBBER.density, 1)[0] / wanted[0] - 1) > 0.1


def test_cages_of_several_sizes_have_the_same_mass_and_centre_and_less_of_everything_else():
    sizes = [len(level.mesh.tets) for level in ring().levels]
    assert sizes == sorted(sizes, reverse=True)
    assert len(set(sizes)) == 3
    first = ring().description
    center, spread = inertia(ring(), first.masses, first.mesh.vertices)
    for level in ring().coarser:
        made_of = level.description
        own, other = inertia(level, made_of.masses, made_of.mesh.vertices)
        assert made_of.masses.sum() == pytest.approx(first.masses.sum(), rel=1e-9)
        assert np.abs(own - center).max() < 0.01
        assert np.abs(other - spread).max() < 0.02 * np.abs(spread).max()
        assert level.skin == ring().skin


@pytest.fixture
def flying():
    """A body in the air that turns, drifts and wobbles."""
    world = bare_world(floor=None)
    world.reserve(ring(), 2)
    body = world.spawn(
        ring(), position=(0.5, 0.0, 3.0), velocity=(2.0, -1.0, 0.5), angular_velocity=(3.0, 1.0, -4.0)
    )
    world.build()
    x = body.positions().astype(np.float64)
    squashed = (x - x.mean(axis=0)) * np.array([1.1, 0.95, 0.95]) + x.mean(axis=0)
    body.set_motion(squashed, body.velocities())
    for _ in range(5):
        world.step(DT)
    return world, body


def moments(body):
    """Centre, momentum and angular momentum about the origin, in float64."""
    m, x, v = body.masses[:, None], body.positions().astype(np.float64), body.velocities().astype(np.float64)
    return (m * x).sum(axis=0) / m.sum(), (m * v).sum(axis=0), (m * np.cross(x, v)).sum(axis=0)


@pytest.mark.parametrize("way", [(1,), (2,), (1, 2, 0), (2, 1, 0, 2)])
def test_a_change_of_level_keeps_centre_momentum_and_angular_momentum(flying, way):
    _, body = flying
    before = moments(body)
    for level in way:
        body.set_level(level)
        assert body.level == level
        assert len(body.tets) == len(ring().levels[level].mesh.tets)
    for name, was, now in zip(("centre", "momentum", "spin"), before, moments(body), strict=True):
        assert np.abs(now - was).max() < 2e-5 * np.abs(was).max(), name


def test_a_rigid_motion_passes_over_exactly_and_a_smooth_bend_nearly(flying):
    """A quadratic field, whose second derivatives both meshes see alike."""
    _, body = flying
    rest = [level.mesh.vertices for level in ring().levels]
    turn, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    far = np.array([1.0, 2.0, 3.0])
    body.set_motion(rest[0] @ turn.T + far, np.cross((1.0, 2.0, 3.0), rest[0]))
    body.set_level(2)
    assert np.abs(body.positions() - (rest[2] @ turn.T + far)).max() < 2e-3  # the centre is kept, 1 mm off
    shape = body.positions() - body.positions().mean(axis=0)
    assert np.abs(shape - (rest[2] - rest[2].mean(axis=0)) @ turn.T).max() < 1e-5

    def bent(x):
        return x + 0.15 * np.stack([x[:, 0] ** 2, -x[:, 0] * x[:, 1], 0 * x[:, 0]], axis=1)

    body.set_level(0)
    body.set_motion(bent(rest[0]) + far, 0 * rest[0])
    body.set_level(1)
    off = body.positions() - far - bent(rest[1])
    assert np.abs(off - off.mean(axis=0)).max() < 0.01


def test_the_skin_stays_where_it_is_and_so_do_its_buffers(flying):
    world, body = flying
    (skin,) = body.render_meshes
    before, normals = (rows.copy() for rows in world.read_render_mesh(skin, 1.0))
    body.set_level(1)
    after, turned = world.read_render_mesh(skin, 1.0)
    assert body.render_meshes == (skin,)
    assert not skin.is_outdated
    assert np.abs(after - before).max() < 0.02
    assert (normals * turned).sum(axis=1).min() > 0.97
    assert skin.body_vertices.max() < body.vertex_count


def test_pins_pass_to_the_nearest_vertices_and_a_hanging_body_stays_hung():
    asset = SoftBodyAsset(BAR[0], RUBBER).with_coarser(BAR[1])
    world = bare_world(floor=None)
    body = world.add_body(asset, position=(0, 0, 2))
    world.build()
    end = BAR[0].vertices[:, 0].min()
    body.pin(np.flatnonzero(BAR[0].vertices[:, 0] == end))
    for _ in range(30):
        world.step(DT)
    body.set_level(1)
    held = body.pinned
    assert (BAR[1].vertices[held, 0] == BAR[1].vertices[:, 0].min()).all()
    assert np.abs(body.positions()[held] - (BAR[1].vertices[held] + [0, 0, 2])).max() < 1e-5
    before = body.positions()[held]
    for _ in range(60):
        world.step(DT)
    assert (body.positions()[held] == before).all()
    assert body.positions()[:, 2].min() < 1.8, "it bends down"
    assert np.isfinite(body.positions()).all()


def test_pins_come_back_as_they_were_from_a_round_trip_and_hold_their_place():
    asset = SoftBodyAsset(BAR[0], RUBBER, pinned=[0, 7, 30]).with_coarser(*BAR[1:])
    world = bare_world(floor=None)
    bodies = [world.add_body(asset, position=(0, 0, 2)), world.add_body(asset, position=(3, 0, 2))]
    world.build()
    end = np.flatnonzero(BAR[0].vertices[:, 0] == BAR[0].vertices[:, 0].min())
    bodies[0].unpin()
    bodies[0].pin(end)
    expected = [end.tolist(), [0, 7, 30]]
    places = [body.positions()[body.pinned] for body in bodies]
    for _ in range(20):
        for level in (2, 1, 0):
            for body in bodies:
                body.set_level(level)
            world.restore(world.snapshot())
            world.step(DT)
    for body, pins, place in zip(bodies, expected, places, strict=True):
        assert body.pinned.tolist() == pins
        assert np.abs(body.positions()[body.pinned] - place).max() < 1e-5


def test_what_was_pinned_at_a_coarse_level_is_held_at_the_finest(flying):
    _, body = flying
    body.set_level(2)
    body.pin([3, 5])
    where = body.positions()[[3, 5]]
    body.set_level(0)
    assert len(body.pinned) == 2
    near = np.linalg.norm(body.positions()[body.pinned][:, None] - where, axis=2).min(axis=0)
    assert near.max() < 0.15


def test_a_push_keeps_its_force_and_its_torque():
    """A change of level preserves the momentum and spin that a force causes in the next step."""
    world = bare_world(gravity=(0, 0, 0), floor=None)
    world.reserve(ring(), 1)
    body = world.spawn(ring(), position=(0.3, 0.2, 1.0))
    world.build()
    before = world.snapshot()
    found = []
    for level in (0, 1, 2):
        world.restore(before)
        body.apply_force((0.0, 4.0, 2.0), np.argsort(ring().mesh.vertices[:, 0])[-20:])
        body.set_level(level)
        world.step(DT)
        found.append(moments(body)[1:])
    for momentum, spin in found[1:]:
        assert momentum == pytest.approx(found[0][0], abs=2e-3 * np.abs(found[0][0]).max())
        assert spin == pytest.approx(found[0][1], abs=2e-3 * np.abs(found[0][1]).max())


def hung_bar(two_way=False):
    """Make a bar with three levels, attached to a frame at each end."""
    world = bare_world(floor=None)
    body = world.add_body(bar(), position=(0, 0, 2))
    world.build()
    ends = [np.flatnonzero(BAR[0].vertices[:, 0] == end) for end in (-0.6, 0.6)]
    frames = [world.add_frame(position=(x, 0.1, 2), rotation=TURNED) for x in (-0.6, 0.6)]
    holds = [body.attach(end, frame, two_way=two_way) for end, frame in zip(ends, frames, strict=True)]
    return world, body, frames, holds, ends


TURNED = np.array([[0.0, -1.0, 0.0], [0.6, 0.0, -0.8], [0.8, 0.0, 0.6]])


def test_attachments_pass_to_the_nearest_vertices_and_go_with_their_frames():
    """The nearest vertices are those in the rest shapes, rotated and moved like the frame."""
    world, body, (left, _), holds, ends = hung_bar()
    for _ in range(20):
        world.step(DT)
    for level in (1, 2, 0, 2):
        body.set_level(level)
        rest = BAR[level].vertices
        for hold, end in zip(holds, (rest[:, 0].min(), rest[:, 0].max()), strict=True):
            assert hold.is_attached
            assert sorted(hold.particles) == np.flatnonzero(rest[:, 0] == end).tolist()
        world.restore(world.snapshot())
        if level == 0:
            assert [hold.particles.tolist() for hold in holds] == [end.tolist() for end in ends]
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    rest, start = BAR[2].vertices, np.array([-0.6, 0.1, 2.0])
    for k in range(1, 61):
        left.move_to(
            start + k / 60 * np.array([0.1, 0, 0.2]),
            np.linalg.matrix_power(turn, 1 if k == 60 else 0) @ TURNED,
        )
        world.step(DT)
    particles = holds[0].particles
    expected = (rest[particles] + [0, 0, 2] - start) @ turn.T + start + [0.1, 0, 0.2]
    assert np.abs(body.positions()[particles] - expected).max() < 1e-3
    held = holds[1].particles
    assert np.abs(body.positions()[held] - rest[held] - [0, 0, 2]).max() < 1e-3
    holds[0].release()
    assert body.pinned.tolist() == sorted(held.tolist())


def test_what_hangs_pulls_with_its_weight_before_and_after_a_change():
    world, body, _, holds, _ = hung_bar(two_way=True)
    body.set_linear_damping(8.0)
    weight = 9.80665 * body.masses.sum()
    for level in (0, 2, 1, 0):
        before = sum(hold.force for hold in holds) if level else None
        body.set_level(level)
        if level:
            assert sum(hold.force for hold in holds) == pytest.approx(before, abs=1e-4 * weight)
        for _ in range(240):
            world.step(DT)
        assert sum(hold.force for hold in holds) == pytest.approx([0, 0, -weight], abs=0.01 * weight)


def test_an_attachment_that_would_hold_nothing_bars_the_change_and_stays():
    world, body, frames, holds, _ = hung_bar()
    near = BAR[2].vertices[np.argmin(np.linalg.norm(BAR[2].vertices, axis=1))]
    first, second = np.argsort(np.linalg.norm(BAR[0].vertices - near, axis=1))[:2]
    body.attach([first], frames[0])
    body.set_level(2)
    body.set_level(0)
    other = body.attach([second], frames[1])
    before = world.state_hash()
    with pytest.raises(StateError, match="nothing at level 2"):
        body.set_level(2)
    assert (world.state_hash(), body.level, other.is_attached) == (before, 0, True)
    assert all(hold.is_attached for hold in holds)


def test_a_restored_body_of_another_level_outdates_what_was_drawn_of_it(flying):
    world, body = flying
    body.set_level(2)
    coarse = world.snapshot()
    body.set_level(0)
    drawn = body.render_mesh()
    world.despawn(body)
    world.restore(coarse)
    assert body.level == 2
    assert drawn.is_outdated
    with pytest.raises(StateError, match="another level"):
        world.read_render_mesh(drawn, 1.0)


def test_snapshots_and_recordings_know_the_level(flying):
    world, body = flying
    fine = world.snapshot()
    body.set_level(2)
    coarse = world.snapshot()
    for _ in range(10):
        world.step(DT)
    end = world.state_hash(), body.positions().copy()
    world.restore(fine)
    assert body.level == 0
    assert len(body.tets) == len(ring().mesh.tets)
    body.set_level(2)
    assert world.snapshot() == coarse
    for _ in range(10):
        world.step(DT)
    assert world.state_hash() == end[0]
    world.restore(fine)
    world.restore(coarse)
    assert body.level == 2
    for _ in range(10):
        world.step(DT)
    assert (world.state_hash(), body.positions().tobytes()) == (end[0], end[1].tobytes())


@pytest.mark.guard
@pytest.mark.soak
def test_warming_up_changes_levels_and_leaves_every_bit(flying):
    world, body = flying
    body.set_level(1)
    drawn = body.render_mesh()
    before = world.state_hash(), body.level, body.positions().tobytes()
    world.warm_up()
    assert not drawn.is_outdated
    assert (world.state_hash(), body.level, body.positions().tobytes()) == before


@pytest.mark.guard
@pytest.mark.soak
def test_after_warming_up_no_change_of_a_level_has_anything_to_prepare(monkeypatch):
    kind = SoftBodyAsset.from_surface(RING, RUBBER, cells=(6, 4, 3))
    world = bare_world()
    world.reserve(kind, 1)
    body = world.spawn(kind, position=(0, 0, 2.0))
    world.build()
    world.warm_up()
    monkeypatch.delattr("taichi_soft.levels.passage.Locator")
    monkeypatch.delattr("taichi_soft.bodies.asset.first_frequency")
    monkeypatch.delattr("taichi_soft.bodies.asset.arrange")
    for level in (1, 2, 1, 0):
        body.set_level(level)
    assert body.level == 0


def test_a_slot_that_a_coarse_body_leaves_is_fine_again_for_the_next(flying):
    world, body = flying
    body.set_level(2)
    world.despawn(body)
    one = world.spawn(ring(), position=(0, 0, 9.0))
    other = world.spawn(ring(), position=(5, 0, 9.0))
    assert (one.index, one.level, len(one.tets)) == (body.index, 0, len(ring().mesh.tets))
    for _ in range(20):
        world.step(DT)
    apart = other.positions() - one.positions()
    assert np.abs(apart - [5.0, 0.0, 0.0]).max() < 5e-5


@pytest.mark.guard
@pytest.mark.soak
def test_levels_in_contact_change_back_and_forth_and_the_pile_stays_whole():
    world = bare_world(soft_contact=True)
    world.reserve(ring(), 3)
    bodies = [world.spawn(ring(), position=(0.05 * i, 0, 0.3 + 0.5 * i)) for i in range(3)]
    world.build()
    rng = np.random.default_rng(7)
    for _ in range(240):
        bodies[rng.integers(3)].set_level(int(rng.integers(3)))
        world.step(DT)
    for body in bodies:
        x = body.positions()
        assert not body.is_frozen
        assert x[:, 2].min() > -0.05
        assert np.ptp(x, axis=0).max() < 2.0
    for body in bodies:
        body.set_level(0)
    for _ in range(240):
        world.step(DT)
    assert max(np.abs(body.velocities()).max() for body in bodies) < 1.5
    assert [body.flipped_count() for body in bodies] == [0, 0, 0]


def test_a_material_of_its_own_bars_a_change(flying):
    _, body = flying
    body.set_level(1)
    body.set_material(Material(2e5, 0.3, 900.0))
    with pytest.raises(StateError, match="material of its own"):
        body.set_level(0)
    body.set_material(ring().levels[1].material)
    with pytest.raises(StateError, match="material of its own"):
        body.set_level(0)


@pytest.mark.parametrize("level", [-1, 3, 1.5, "coarse", None, True])
def test_a_level_that_there_is_not_is_refused(flying, level):
    world, body = flying
    before = world.state_hash()
    with pytest.raises(OptionError, match="level"):
        body.set_level(level)
    assert world.state_hash() == before


def test_a_frozen_body_and_a_world_that_is_not_built_change_nothing():
    world = bare_world(floor=None, retries=0)
    body = world.add_body(ring())
    with pytest.raises(StateError, match="not built"):
        body.set_level(1)
    world.build()
    far = ring().mesh.vertices * np.array([40.0, 0.02, 30.0])
    body.set_motion(far, 1e3 * np.random.default_rng(0).normal(size=far.shape))
    with pytest.warns(FrozenBodyWarning):
        world.step(0.5, substeps=1)
    with pytest.raises(StateError, match="is frozen"):
        body.set_level(1)
    assert body.level == 0


def test_levels_that_are_none_are_refused(monkeypatch):
    """They are refused before their constants are estimated, which takes seconds."""
    monkeypatch.setattr("taichi_soft.bodies.asset.calibrated", lambda *_: pytest.fail("sought constants"))
    asset = SoftBodyAsset(BAR[0], RUBBER)
    with pytest.raises(MeshError, match="must be a TetMesh"):
        asset.with_coarser(rope(1.0, 4, mass=0.1))
    with pytest.raises(MeshError, match="are not fewer than"):
        SoftBodyAsset(BAR[1], RUBBER).with_coarser(BAR[0])
    with pytest.raises(MeshError, match="of the level before"):
        asset.with_coarser(BAR[2], BAR[1])
    with pytest.raises(MeshError, match="of the level before"):
        SoftBodyAsset.from_surface(RING, RUBBER, cells=(5, 5))
    with pytest.raises(MeshError, match="must be the same body"):
        asset.with_coarser(box((1.2, 0.3, 2.5), (4, 1, 1)))
    with pytest.raises(OptionError, match="cells"):
        SoftBodyAsset.from_surface(RING, RUBBER, cells=(None, 5))
    with pytest.raises(OptionError, match="no levels of detail"):
        SoftBodyAsset(BAR[0], RUBBER, coarser=(SoftBodyAsset(BAR[1], RUBBER),), spare_vertices=10)
    with pytest.raises(OptionError, match="no levels of detail"):
        SoftBodyAsset(BAR[0], RUBBER, law="springs").with_coarser(BAR[1])
    with pytest.raises(OptionError, match=r"coarser.*tuple"):
        SoftBodyAsset(BAR[0], RUBBER, coarser=(BAR[1],))
    with pytest.raises(OptionError, match="law and the contact"):
        SoftBodyAsset(BAR[0], RUBBER, coarser=(SoftBodyAsset(BAR[1], RUBBER, law="virial"),))
    with pytest.raises(MaterialError, match="one number for each constant"):
        SoftBodyAsset(BAR[0], Material(np.full(len(BAR[0].tets), 1e5), 0.3, 900.0)).with_coarser(BAR[1])
    with pytest.raises(OptionError, match="cells is empty"):
        SoftBodyAsset.from_surface(RING, RUBBER, cells=())
    assert SoftBodyAsset(sphere(0.5, 2), RUBBER).levels[0].coarser == ()


def test_what_spawns_after_a_rewind_does_not_take_over_the_level_of_who_was_there_before():
    """Vibrations of the finest level decay at the rate of this level.

    The levels of the slot's earlier bodies, at the snapshot and at its restoration, do not matter.
    """
    damped = SoftBodyAsset(BAR[0], Material(8e4, 0.4, 900.0, damping_ratio=0.3)).with_coarser(BAR[1])
    world = bare_world(floor=None)
    world.reserve(damped, 1)
    world.build()

    def spawned():
        body = world.spawn(damped, angular_velocity=(0, 6, 2))
        for _ in range(5):
            world.step(DT)
        return body

    first = spawned()
    first.set_level(1)
    world.despawn(first)
    kept = world.snapshot()
    expected = spawned().velocities()
    world.restore(kept)
    np.testing.assert_array_equal(spawned().velocities(), expected)
