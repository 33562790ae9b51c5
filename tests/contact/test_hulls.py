"""Bodies whose contact with colliders and bodies uses the hull of their drawn surface."""

import numpy as np
import pytest
import trimesh

from taichi_soft import (
    BoxShape,
    Contact,
    FrozenBodyWarning,
    Material,
    MeshError,
    OptionError,
    PlaneShape,
    SoftBodyAsset,
    TetMesh,
    box,
)
from taichi_soft.render.replay import replay
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak

DT = 1 / 60
JELLY = Material(2e6, 0.3, 500.0, damping_ratio=0.5)
ALONG_AXES = np.vstack([np.eye(3), -np.eye(3)])


def ball(radius=0.5, at=(0, 0, 0)):
    return trimesh.creation.icosphere(subdivisions=3, radius=radius).apply_translation(at)


def urchin():
    """Make a ball with six rods that are thinner than a cell of its cage and protrude from the cage."""
    rods = []
    for way in ALONG_AXES:
        rod = trimesh.creation.cylinder(0.03, 0.5, sections=12)
        rods.append(
            rod.apply_transform(trimesh.geometry.align_vectors((0, 0, 1), way)).apply_translation(0.6 * way)
        )
    return trimesh.util.concatenate([ball(0.4), *rods])


def table(leg):
    """A slab on four legs of a length [m], thinner than a cell of its cage. They end at a height of 0."""
    legs = [
        trimesh.creation.cylinder(0.05, leg + 0.1, sections=12).apply_translation((x, y, 0.5 * leg + 0.05))
        for x in (-0.37, 0.41)
        for y in (-0.33, 0.36)
    ]
    return trimesh.util.concatenate(
        [trimesh.creation.box((1, 0.9, 0.3)).apply_translation((0, 0, leg + 0.15)), *legs]
    )


def asset_of(surface, hull=1000, cells=6, **options):
    return SoftBodyAsset.from_surface(surface, JELLY, cells=cells, hull=hull, **options)


def drawn(world, body):
    return world.read_render_mesh(body.render_meshes[0], 1.0)[0].astype(np.float64)


def at_rest(world, body, seconds=3.0):
    for _ in range(round(seconds / DT)):
        world.step(DT)
    assert np.linalg.norm(body.momentum()) < 0.02 * body.masses.sum()
    return drawn(world, body)


@pytest.mark.parametrize("leg", [0.08, 0.15])
def test_a_body_with_thin_parts_rests_on_what_is_drawn_of_it(leg):
    """With a hull, the drawn surface touches the floor.

    A cage of five cells is larger than the legs, or the legs protrude from it. Without a hull, the body would
    hover or sink in by at least 1.5 % of its size.
    """
    gaps = {}
    for hull in (None, 500):
        world = bare_world(floor=0.0, soft_contact=True)
        body = world.add_body(asset_of(table(leg), hull, cells=5), position=(0, 0, 0.06))
        world.build()
        gaps[hull] = abs(at_rest(world, body, 4.5)[:, 2].min())
    assert gaps[None] > 0.015
    assert gaps[500] < 0.002


@pytest.mark.guard
def test_a_body_lies_on_what_is_drawn_of_another():
    """A plate on a ball, both by their hulls: their drawn surfaces meet to 1 % of the ball."""
    world = bare_world(floor=0.0, soft_contact=True, friction=1.0)
    heavy = asset_of(ball(), pinned=())
    lower = world.add_body(heavy, position=(0, 0, 0.5))
    plate = trimesh.creation.box((0.6, 0.6, 0.2)).subdivide().subdivide().subdivide().subdivide()
    upper = world.add_body(asset_of(plate, 600), position=(0, 0, 1.11))
    world.build()
    lower.pin(np.flatnonzero(heavy.mesh.vertices[:, 2] < 0.2))
    world.step(DT)
    for _ in range(60):
        world.step(DT)
    top, under = drawn(world, lower), drawn(world, upper)
    top, under = top[top[:, 2] > 0.9], under[plate.vertices[:, 2] < -0.09]
    nearest = np.linalg.norm(top[:, None, :2] - under[None, :, :2], axis=2).argmin(axis=1)
    gap = (under[nearest, 2] - top[:, 2]).min()
    assert abs(gap) < 0.01


def trembling(body):
    """Return the speed of each vertex relative to the rigid motion of its body, (n,) [m/s]."""
    m, x, v = body.masses[:, None], body.positions().astype(float), body.velocities().astype(float)
    x = x - (m * x).sum(axis=0) / m.sum()
    v = v - (m * v).sum(axis=0) / m.sum()
    spin = np.linalg.solve(
        (m[:, 0] * (x**2).sum(axis=1)).sum() * np.eye(3) - (m * x).T @ x, (m * np.cross(x, v)).sum(axis=0)
    )
    return np.linalg.norm(v - np.cross(spin, x), axis=1)


def cube_of(edge=0.6):
    return trimesh.creation.box((edge, edge, edge)).subdivide().subdivide().subdivide()


@pytest.mark.parametrize("hull", [True, None])
def test_no_vertex_of_a_body_at_rest_is_faster_than_gravity_makes_it_within_a_substep(hull):
    """The support removes the speed that gravity adds in a step.

    The test includes a hull whose points share vertices.
    """
    asset = asset_of(cube_of(), hull)
    world = bare_world(floor=0.0, soft_contact=True)
    body = world.add_body(asset, position=(0, 0, 0.303))
    world.build()
    for _ in range(120):
        world.step(DT)
    speeds = []
    for _ in range(20):
        world.step(DT)
        speeds.append(trembling(body))
    worst = np.sqrt((np.array(speeds) ** 2).mean(axis=0)).max()
    assert worst < 9.81 * asset.stable_step.recommended
    assert abs(drawn(world, body)[:, 2].min()) < 0.02 * 0.6


@pytest.mark.parametrize("friction", [0.5, 0.2])
def test_a_body_on_a_slope_sticks_or_slides_as_coulomb_has_it(friction):
    """A slope of 20 degrees, tan 20 = 0.36: above it sticks, below it slides with g (sin - mu cos)."""
    slope = np.radians(20)
    turn = np.array([0, np.sin(slope / 2), 0, np.cos(slope / 2)])
    down, up = np.array([np.cos(slope), 0, -np.sin(slope)]), np.array([np.sin(slope), 0, np.cos(slope)])
    world = bare_world(floor=None, soft_contact=True, collider_room=2)
    body = world.add_body(asset_of(cube_of(), True), position=0.303 * up, rotation=turn)
    world.add_collider(BoxShape((20, 20, 0.5)), position=-0.5 * up, rotation=turn, friction=friction)
    world.build()
    way = []
    for _ in range(150):
        world.step(DT)
        way.append(body.center_of_mass() @ down)
    if friction > np.tan(slope):
        assert abs(way[-1] - way[-61]) < 0.2e-3  # within a second
    else:
        t = np.arange(30, 90) * DT
        acceleration = 2 * np.polyfit(t, way[30:90], 2)[0]
        expected = 9.81 * (np.sin(slope) - friction * np.cos(slope))
        assert acceleration == pytest.approx(expected, rel=0.02)


def test_balls_that_meet_at_20_m_s_part_again():
    """For any orientation and offset, balls neither pass through each other nor get stuck."""
    asset = asset_of(ball(), 500)
    for seed in range(16):
        random = np.random.default_rng(seed)
        offset, angle = random.uniform(0, 0.7), random.uniform(0, 6.28)
        turns = random.normal(size=(2, 4))
        turns /= np.linalg.norm(turns, axis=1, keepdims=True)
        place = 1.02 + random.uniform(0, 0.5), offset * np.cos(angle), offset * np.sin(angle)
        if offset > 0.45:
            continue  # the balls would rather pass each other than collide
        world = bare_world(gravity=(0, 0, 0), floor=None, soft_contact=True)
        first = world.add_body(asset, velocity=(20, 0, 0), rotation=turns[0])
        second = world.add_body(asset, position=place, velocity=(-20, 0, 0), rotation=turns[1])
        world.build()
        for _ in range(20):
            world.step(DT)
            apart = second.center_of_mass() - first.center_of_mass()
            assert apart[0] > 0, seed
        assert np.linalg.norm(apart) > 3.0, seed
        assert np.abs(momenta(world)[0]).max() < 1e-5 * 20 * first.masses.sum()


def test_a_body_bounces_no_higher_than_it_fell():
    """The body touches the floor by its hull. The restitution is 0.9."""
    world = bare_world(floor=0.0, soft_contact=True, restitution=0.9)
    body = world.add_body(asset_of(ball()), position=(0, 0, 1.5))
    world.build()
    heights = []
    for _ in range(150):
        world.step(DT)
        heights.append(body.center_of_mass()[2])
    lowest = int(np.argmin(heights[:60]))
    assert 0.7 < max(heights[lowest:]) < 1.5


def momenta(world):
    """Momentum and angular momentum of all bodies."""
    linear, angular = np.zeros(3), np.zeros(3)
    for body in world.bodies:
        m, x, v = body.masses[:, None], body.positions().astype(float), body.velocities().astype(float)
        linear += (m * v).sum(axis=0)
        angular += np.cross(x, m * v).sum(axis=0)
    return linear, angular


@pytest.mark.parametrize("other", [500, None])
def test_momentum_and_angular_momentum_of_two_that_meet(other):
    """The bodies meet off centre, with friction. The second body has a hull or none."""
    world = bare_world(gravity=(0, 0, 0), floor=None, soft_contact=True)
    contact = Contact(friction=0.8)
    first = world.add_body(asset_of(ball(), 500, contact=contact), velocity=(2, 0, 0))
    second = world.add_body(
        asset_of(ball(), other, contact=contact), position=(1.1, 0.4, 0.1), velocity=(-2, 0, 0)
    )
    world.build()
    before = momenta(world)
    world.step(DT)
    scale = np.abs(first.momentum()).max()
    for _ in range(40):
        world.step(DT)
    after = momenta(world)
    assert first.momentum()[0] < 0 < second.momentum()[0]  # they met
    assert (
        np.linalg.norm(np.cross(first.positions() - first.center_of_mass(), first.velocities()).mean(axis=0))
        > 0.01
    )
    assert np.abs(after[0] - before[0]).max() < 1e-4 * scale
    assert np.abs(after[1] - before[1]).max() < 2e-4 * scale


FLESH = Material(1.0, 0.2, 800.0)  # so soft that forces have no effect within a step
SHARDS = TetMesh(
    [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.8, 0.9, 0.7]],
    [[0, 1, 2, 3], [4, 1, 3, 2]],
    fix_orientation=True,
)
POINTS = np.array([[0.2, 0.1, -0.3], [0.9, 0.1, 0.4], [0.1, 0.8, 0.4], [0.2, 0.2, 0.9]])
FACES = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]


def weights_of(point):
    """Return the weights of the first tetrahedron's vertices. Its edges are along the axes."""
    return np.array([1 - point.sum(), *point])


def test_one_impulse_at_one_point_as_an_equation_has_it():
    """Inelastic, sliding: P is along the normal so that the point stops there, friction at its bound."""
    asset = SoftBodyAsset(SHARDS, FLESH, hull=(POINTS, FACES))
    world = bare_world(gravity=(0, 0, 0), floor=None, soft_contact=True, collider_room=2)
    body = world.add_body(asset, velocity=(3.0, 0.5, -1.0), position=(0, 0, 1.0))
    wall = world.add_collider(PlaneShape(), friction=0.2, position=(0.5, 0.25, 0.695))
    world.build()
    mass, v = body.masses, np.tile([3.0, 0.5, -1.0], (5, 1))
    world.step(0.01, 1)
    w = np.append(weights_of(POINTS[0]), 0.0)
    inv_mass = (w**2 / mass).sum()
    normal_impulse = 1.0 / inv_mass
    sliding = np.array([3.0, 0.5, 0.0])
    impulse = np.array([0, 0, normal_impulse]) - 0.2 * normal_impulse * sliding / np.linalg.norm(sliding)
    expected = v + (w / mass)[:, None] * impulse
    assert body.velocities() == pytest.approx(expected, abs=2e-4)
    assert wall.impulse == pytest.approx(-impulse, rel=1e-4)
    place = np.array([0, 0, 1.0]) + POINTS[0]
    turning = np.cross(place - [0.5, 0.25, 0.695], -impulse)
    assert wall.angular_impulse == pytest.approx(turning, rel=0.05, abs=0.02 * np.abs(turning).max())


def test_what_a_collider_feels_is_what_a_body_loses():
    """The body falls with friction onto a moving box.

    Momentum and angular momentum about the box are compared.
    """
    world = bare_world(gravity=(0, 0, 0), floor=None, soft_contact=True, collider_room=2)
    world.add_body(asset_of(urchin(), 500), position=(0, 0, 1.0), velocity=(1, 0.3, -3))
    ram = world.add_collider(BoxShape((1, 1, 0.2)), position=(0.2, 0, 0.0), friction=0.7)
    world.build()
    struck, turned = np.zeros(3), np.zeros(3)
    before = momenta(world)
    for _ in range(30):
        world.step(DT)
        struck += ram.impulse
        turned += ram.angular_impulse + np.cross(ram.position, ram.impulse)
    after = momenta(world)
    scale = np.abs(before[0]).max()
    assert np.abs(struck).max() > 0.5 * scale
    assert struck == pytest.approx(before[0] - after[0], abs=2e-3 * scale)
    assert turned == pytest.approx(before[1] - after[1], abs=5e-3 * scale)


def heap():
    world = bare_world(soft_contact=True, record=200)
    asset = asset_of(urchin(), 300)
    for i in range(3):
        world.add_body(asset, position=(0.05 * i, 0.1 * i, 0.9 + 1.75 * i))
    world.add_body(box((0.5, 0.5, 0.5), (2, 2, 2)), JELLY, position=(-0.2, 0, 5.9))
    world.build()
    return world


def bits(world):
    return [each.tobytes() for body in world.bodies for each in (body.positions(), body.velocities())]


@pytest.mark.guard
def test_rewinding_and_recordings_are_exact(tmp_path):
    world = heap()
    for _ in range(50):
        world.step(DT)
    kept = world.snapshot()
    for _ in range(20):
        world.step(DT)
    once = bits(world)
    world.restore(kept)
    for _ in range(20):
        world.step(DT)
    assert bits(world) == once
    report = replay(world.save_recording(tmp_path / "heap.recording"))
    assert report.first_difference is None


def test_a_world_whose_body_has_frozen_on_its_hull_is_taken_back():
    world = bare_world()
    world.add_body(asset_of(urchin(), 300), position=(9.9999e6, 0, 3), velocity=(1.9e4, 0, 0))
    world.build()
    with pytest.warns(FrozenBodyWarning):
        world.step(1 / 60)
    state = world.state_hash()
    world.restore(world.snapshot())
    assert world.state_hash() == state


def test_a_body_without_hull_moves_beside_hulls_as_without_them():
    """One box is thrown onto another. A distant body has a hull or none."""
    found = []
    for hull in (300, None):
        world = bare_world(soft_contact=True)
        for z, speed in ((0.3, 0.0), (0.9, -1.0)):
            world.add_body(
                box((0.5, 0.5, 0.5), (2, 2, 2)), JELLY, position=(0, 0.1 * z, z), velocity=(0, 0, speed)
            )
        world.add_body(asset_of(ball(), hull), position=(30, 0, 0.6))
        world.build()
        for _ in range(30):
            world.step(DT)
        found.append([body.positions() for body in world.bodies[:2]])
    assert np.concatenate(found[0]) == pytest.approx(np.concatenate(found[1]), abs=1e-3)


def test_a_hull_stays_where_it_is_when_the_level_changes():
    asset = SoftBodyAsset.from_surface(table(0.08), JELLY, cells=(8, 5), hull=400)
    hulls = [level.bound_hull.points for level in asset.levels]
    assert hulls[0] == pytest.approx(hulls[1], abs=1e-6)
    world = bare_world(floor=0.0, soft_contact=True)
    body = world.add_body(asset, position=(0, 0, 0.02))
    world.build()
    at_rest(world, body, 1.5)
    body.set_level(1)
    assert abs(at_rest(world, body, 1.0)[:, 2].min()) < 0.004


def test_a_body_falls_asleep_on_its_hull_and_wakes():
    world = bare_world(soft_contact=True, sleep_speed=0.05, collider_room=2)
    body = world.add_body(asset_of(table(0.08), 300), position=(0, 0, 0.02))
    world.build()
    for _ in range(240):
        world.step(DT)
    assert body.is_asleep
    wall = world.add_collider(BoxShape((0.2, 0.2, 0.2)), position=(5, 0, 0.25))
    wall.set_velocity((-6, 0, 0))
    for _ in range(60):
        world.step(DT)
    assert not body.is_asleep
    assert body.center_of_mass()[0] < -0.1


def test_a_body_that_skips_a_step_makes_it_where_a_collider_comes_near_its_hull():
    """The hull protrudes from the cage by 0.15 m, and the collider is near the hull only."""
    wide = trimesh.creation.box((0.6, 0.6, 0.6)).subdivide()
    asset = SoftBodyAsset(box((0.3, 0.3, 0.3), (2, 2, 2)), JELLY, skin=wide, hull=60)
    world = bare_world(soft_contact=True, collider_room=2)
    body = world.add_body(asset, position=(0, 0, 3.0))
    world.build()
    wall = world.add_collider(BoxShape((0.1, 0.1, 0.1)), position=(0.38, 0, 3.0))
    for speed, stands in ((-1.5, False), (0.0, True)):
        wall.set_velocity((speed, 0, 0))
        before = body.positions()
        world.skip_step([body])
        world.step(DT)
        assert np.array_equal(body.positions(), before) == stands


@pytest.mark.parametrize(
    ("hull", "error", "words"),
    [
        (11, OptionError, "hull"),
        (20_001, OptionError, "hull"),
        (100.5, OptionError, "hull"),
        (False, OptionError, "hull"),
        ("nowhere.glb", MeshError, "nowhere.glb"),
        ((POINTS, [[0, 1, 1]]), MeshError, "twice"),
        ((np.zeros((4, 3)), FACES), MeshError, "no extent"),
    ],
)
def test_bad_hulls_are_refused(hull, error, words):
    with pytest.raises(error, match=words):
        SoftBodyAsset.from_surface(ball(), JELLY, cells=4, hull=hull)


def test_without_a_number_a_hull_has_about_twice_the_outer_vertices_of_the_cage():
    asset = SoftBodyAsset.from_surface(ball(), JELLY, cells=4, hull=True)
    assert len(asset.hull.points) == pytest.approx(2 * len(np.unique(asset.mesh.surface)), rel=0.2)


def test_what_takes_no_hull_is_refused():
    mesh = box(cells=(2, 2, 2))
    with pytest.raises(OptionError, match="no skin"):
        SoftBodyAsset(mesh, JELLY, hull=100)
    with pytest.raises(MeshError, match="of the same body"):
        _ = SoftBodyAsset(mesh, JELLY, hull=ball(at=(9, 0, 0))).arrays
    with pytest.raises(OptionError, match="cut"):
        SoftBodyAsset(mesh, JELLY, skin=ball(), hull=100, spare_vertices=10)
    with pytest.raises(OptionError, match="itself"):
        SoftBodyAsset(mesh, JELLY, skin=ball(), hull=100, contact=Contact(itself=True))
    world = bare_world(integrator="implicit_euler")
    world.add_body(SoftBodyAsset(mesh, JELLY, skin=ball(), hull=100), position=(0, 0, 1))
    with pytest.raises(OptionError, match="implicit_euler"):
        world.build()
    coarser = SoftBodyAsset(box(cells=(1, 1, 1)), JELLY, skin=ball(), hull=50)
    with pytest.raises(OptionError, match="hull of the finest"):
        SoftBodyAsset(mesh, JELLY, skin=ball(), hull=100, coarser=(coarser,))
