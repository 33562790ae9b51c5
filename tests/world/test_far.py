"""Far from the origin of the world, bodies move and rest as they do near it.

The oracle of most tests is the same scene near the origin, or a closed form in float64.
"""

import numpy as np
import pytest

from taichi_soft import BoxShape, Material, SoftBodyAsset, World, box, sphere
from taichi_soft.world.bare import bare_world

DT = 1 / 60
RUBBER = Material(young=1e5, poisson=0.4, density=1100.0)
CUBE = box((0.1, 0.1, 0.1), (2, 2, 2))
TOP = np.flatnonzero(CUBE.vertices[:, 2] > 0.04)
FAR = 20_003.7  # no multiple of the distance between origins


def speed(body):
    """Highest speed of a vertex [m/s]."""
    return float(np.abs(body.velocities()).max())


def inner(body):
    """Positions relative to the centre of mass, in float64 [m]."""
    return body.exact_positions() - body.center_of_mass()


@pytest.fixture(scope="module")
def rest():
    """Cubes on the floor, on a box and on each other: the same at 0 and far away, and what they do in 5 s."""
    world = World(floor=0.0)
    asset = SoftBodyAsset(CUBE, RUBBER)
    bodies = []
    for x in (0.0, FAR):
        places = ((x, 0, 0.06), (x, 1, 0.06), (x, 1, 0.18), (x, 3, 0.46))
        bodies.append([world.add_body(asset, position=place) for place in places])
        world.add_collider(BoxShape((0.5, 0.5, 0.1)), position=(x + 0.003, 3.001, 0.3))
    world.build()
    asleep, speeds = {}, []
    for step in range(300):
        world.step(DT)
        speeds.append([[speed(body) for body in group] for group in bodies])
        for group in bodies:
            for body in group:
                if body.is_asleep:
                    asleep.setdefault(body.index, step)
    return world, bodies, asleep, np.array(speeds)


def test_cubes_far_away_come_to_rest_as_near_the_origin(rest):
    _, (near, far), _, speeds = rest
    assert speeds[-30:].max() == 0.0
    assert np.abs(speeds[180:, 1] - speeds[180:, 0]).max() < 2e-3
    for a, b in zip(near, far, strict=True):
        assert b.center_of_mass()[2] == pytest.approx(a.center_of_mass()[2], abs=5e-4)
        assert np.abs(inner(a) - inner(b)).max() < 5e-4


def test_cubes_far_away_fall_asleep_as_soon_as_near_the_origin(rest):
    _, (near, far), asleep, _ = rest
    for a, b in zip(near, far, strict=True):
        assert abs(asleep[a.index] - asleep[b.index]) <= 30


def test_positions_are_those_of_the_world(rest):
    _, (_, far), _, _ = rest
    for body in far:
        x = body.positions()
        assert np.abs(x[:, 0] - FAR).max() < 0.1
        assert np.abs(x - body.exact_positions()).max() <= 1e-3
        assert np.array_equal(x, body.exact_positions().astype(np.float32))


@pytest.fixture(scope="module")
def flight():
    """A world with two slots, without gravity's floor."""
    world = bare_world(floor=None)
    asset = SoftBodyAsset(CUBE, RUBBER)
    world.reserve(asset, 2)
    body = world.spawn(asset, position=(0, 0, 0))
    world.build()
    world.despawn(body)
    return world, asset


def test_a_thrown_cube_follows_a_parabola_across_the_borders_of_cells(flight):
    world, asset = flight
    start, velocity = np.array([FAR, -FAR, 90.0]), np.array([31.0, -17.0, 23.0])
    body = world.spawn(asset, position=start, velocity=velocity)
    origins, longest = set(), 0.0
    before, step = body.center_of_mass(), 0
    for step in range(1, 181):
        world.step(DT)
        time, now = step * DT, body.center_of_mass()
        expected = start + velocity * time + 0.5 * np.array([0.0, 0.0, -9.81]) * time**2
        assert np.abs(now - expected).max() < 1e-4
        longest = max(longest, float(np.linalg.norm(now - before)))
        before = now
        assert np.abs(inner(body) - inner_at_rest()).max() < 1e-4
        origins.add(tuple(world_state(world).body_origin.to_numpy()[body.index]))
    assert len(origins) > 5
    assert longest < DT * 50.0
    world.despawn(body)


def inner_at_rest():
    """Positions of the vertices of a cube relative to its centre [m]."""
    return CUBE.vertices - CUBE.vertices.mean(axis=0)


def world_state(world):
    """Fields of a world."""
    from taichi_soft.world.world import context_of_world

    return context_of_world(world).built.state


def test_momentum_and_shape_stay_the_same_when_the_origin_changes(flight):
    world, asset = flight
    body = world.spawn(asset, position=(FAR, 0, 0), velocity=(60.0, 0, 0), angular_velocity=(0, 0, 5.0))
    body.set_gravity_scale(0.0)
    world.step(DT)
    momentum, energy = body.momentum(), body.kinetic_energy()
    for _ in range(120):
        world.step(DT)
    assert np.abs(body.momentum() - momentum).max() < 1e-5 * np.linalg.norm(momentum)
    assert body.kinetic_energy() == pytest.approx(energy, rel=1e-4)
    world.despawn(body)


def test_a_snapshot_between_two_cells_continues_with_the_same_bits(flight):
    world, asset = flight
    body = world.spawn(asset, position=(FAR, FAR, 0), velocity=(40.0, 3.0, 10.0), angular_velocity=(1, 2, 3))
    for _ in range(20):
        world.step(DT)
    saved = world.snapshot()
    hashes = []
    for _ in range(2):
        for _ in range(60):
            world.step(DT)
        hashes.append((world.state_hash(), body.exact_positions().tobytes()))
        world.restore(saved)
    assert hashes[0] == hashes[1]
    world.despawn(body)


def test_reading_changes_no_bit(flight):
    world, asset = flight
    body = world.spawn(asset, position=(FAR, FAR, 0), velocity=(1.0, 0, 0), angular_velocity=(1, 2, 3))
    for _ in range(3):
        world.step(DT)
    before = world.state_hash(), body.exact_positions().tobytes(), body.positions().tobytes()
    body.velocities(), body.stresses(), body.pose(), body.elastic_energy(), world.read_positions(body, 0.5)
    assert (world.state_hash(), body.exact_positions().tobytes(), body.positions().tobytes()) == before
    world.despawn(body)


def test_a_spawned_and_a_teleported_cube_have_no_strain(flight):
    world, asset = flight
    body = world.spawn(asset, position=(FAR, FAR, FAR))
    assert np.abs(body.strains()).max() < 1e-4
    body.teleport((-FAR, 123.4, 5.6))
    assert np.abs(body.strains()).max() < 1e-4
    assert np.abs(body.center_of_mass() - (-FAR, 123.4, 5.6)).max() < 1e-6
    body.set_motion(CUBE.vertices + np.array((FAR, 0, -FAR)), np.zeros((len(CUBE.vertices), 3)))
    assert np.abs(body.strains()).max() < 1e-4
    body.teleport((1.0, 2.0, 3.0))
    assert np.abs(body.positions() - CUBE.vertices - (1, 2, 3)).max() < 1e-6
    world.despawn(body)


def test_the_origin_shifted_to_a_far_body_changes_nothing_of_its_motion(flight):
    world, asset = flight
    body = world.spawn(asset, position=(FAR, 0, 0), angular_velocity=(1, 2, 3))
    for _ in range(10):
        world.step(DT)
    shape = inner(body)
    world.shift_origin((FAR, 0, 0))
    assert np.abs(body.center_of_mass()[:2]).max() < 1e-4
    assert np.abs(inner(body) - shape).max() < 2e-6
    world.shift_origin((-FAR, 0, 0))
    assert np.abs(inner(body) - shape).max() < 4e-6
    world.despawn(body)


def test_drawn_positions_are_relative_to_the_view_and_exact(flight):
    world, asset = flight
    body = world.spawn(asset, position=(FAR, FAR, 0), velocity=(3.0, 0, 0), angular_velocity=(1, 2, 3))
    body.set_gravity_scale(0.0)
    earlier = body.exact_positions()
    for _ in range(10):
        earlier = body.exact_positions()
        world.step(DT)
    now = body.exact_positions()
    camera = np.array([FAR + 0.3, FAR - 0.123, 0.4])
    world.set_view_origin(camera)
    mesh = body.render_mesh()
    for alpha in (0.0, 0.25, 1.0):
        expected = earlier + alpha * (now - earlier) - camera
        assert np.abs(world.read_positions(body, alpha) - expected).max() < 1e-6
        drawn, normals = world.read_render_mesh(mesh, alpha)
        assert np.abs(drawn.mean(axis=0) - expected[body_vertices(mesh)].mean(axis=0)).max() < 1e-6
        assert np.abs(np.linalg.norm(normals, axis=1) - 1.0).max() < 1e-5
    assert np.abs(body.positions() - now).max() <= 1e-3  # still in the world
    world.set_view_origin((0.0, 0.0, 0.0))
    assert np.array_equal(world.read_positions(body, 1.0), body.positions())
    world.despawn(body)


def body_vertices(mesh):
    """Vertices of the body at the vertices of its render mesh."""
    return np.asarray(mesh.body_vertices)


@pytest.fixture(scope="module")
def held():
    """A world in which bodies are held, pulled and joined, near the origin and far away."""
    world = bare_world(floor=None, soft_contact=True, collider_room=2)
    asset = SoftBodyAsset(CUBE, RUBBER)
    world.reserve(asset, 6)
    world.build()
    return world, asset


def test_a_cube_on_a_slow_frame_far_away_moves_smoothly(held):
    world, asset = held
    body = world.spawn(asset, position=(FAR, 0, 0))
    frame = world.add_frame((FAR, 0.0, 0.05))
    body.attach(TOP, frame)
    for step in range(60):
        frame.move_to((FAR + 1e-4 * step, 0.0, 0.05))
        world.step(DT)
        if step > 40:
            assert np.abs(body.velocities()[TOP, 0] - 1e-4 / DT).max() < 2e-4
    gap = body.exact_positions()[TOP] - CUBE.vertices[TOP] - (FAR + 59e-4, 0, 0)
    assert np.abs(gap).max() < 1e-5
    frame.remove()
    world.despawn(body)


def test_pinned_vertices_far_away_reach_their_targets(held):
    world, asset = held
    body = world.spawn(asset, position=(0, FAR, 0))
    body.pin(TOP)
    start = body.exact_positions()[TOP]
    for step in range(1, 31):
        body.set_targets(TOP, start + np.array((2e-4 * step, 0, 0)))
        world.step(DT)
        assert np.abs(body.exact_positions()[TOP] - start - (2e-4 * step, 0, 0)).max() < 2e-6
    world.despawn(body)


def test_a_grab_far_away_pulls_as_near_the_origin(held):
    world, asset = held
    ends = []
    for x in (0.0, FAR):
        body = world.spawn(asset, position=(x, 0, 0))
        grab = body.grab(0)
        for step in range(90):
            grab.move((x + 0.0123 + 1e-5 * step, 0.05, 0.0456))
            world.step(DT)
        ends.append(body.exact_positions() - (x, 0, 0))
        grab.release()
        world.despawn(body)
    assert np.abs(ends[1] - ends[0]).max() < 2e-4


def test_a_joint_holds_where_bodies_cross_the_borders_of_cells(held):
    world, asset = held
    a = world.spawn(asset, position=(FAR, 0, 0), velocity=(50.0, 0, 0))
    b = world.spawn(asset, position=(FAR, 0, -0.1), velocity=(50.0, 0, 0))
    for body in (a, b):
        body.set_gravity_scale(0.0)
    bottom = np.flatnonzero(CUBE.vertices[:, 2] < -0.04)
    a.attach_to(b, bottom, onto=TOP)
    momentum = a.momentum() + b.momentum()
    for _ in range(90):
        world.step(DT)
        gap = a.exact_positions()[bottom].mean(axis=0) - b.exact_positions()[TOP].mean(axis=0)
        assert np.abs(gap).max() < 1e-4
    assert np.abs(a.momentum() + b.momentum() - momentum).max() < 1e-4 * np.linalg.norm(momentum)
    world.despawn(a)
    world.despawn(b)


def test_a_moving_collider_far_away_carries_a_cube_smoothly(held):
    world, asset = held
    lift = world.add_collider(BoxShape((0.3, 0.3, 0.1)), position=(FAR, 0, 0))
    body = world.spawn(asset, position=(FAR, 0, 0.151))
    for step in range(180):
        lift.move_to((FAR, 0, 1e-4 * step))
        world.step(DT)
    assert np.abs(body.velocities()[:, 2] - 1e-4 / DT).max() < 3e-3
    assert np.abs(body.velocities()[:, :2]).max() < 2e-3
    lift.remove()
    world.despawn(body)


@pytest.mark.parametrize(
    "options",
    [{"schedule": "flat"}, pytest.param({"integrator": "implicit_euler"}, marks=pytest.mark.soak)],
)
def test_other_schedules_and_integrators_rest_far_away_as_near_the_origin(options):
    world = bare_world(floor=0.0, **options)
    near, far = (world.add_body(CUBE, RUBBER, position=(x, 0, 0.06)) for x in (0.0, FAR))
    world.build()
    for _ in range(150):
        world.step(DT)
    assert speed(far) <= 2.0 * speed(near) + 2e-4
    assert np.abs(inner(far) - inner(near)).max() < 1e-4
    assert far.center_of_mass()[2] == pytest.approx(near.center_of_mass()[2], abs=1e-4)


@pytest.mark.soak
def test_rigid_bodies_hulls_and_pieces_far_away_do_as_near_the_origin():
    world = World(floor=0.0)
    crate = SoftBodyAsset.rigid(box((0.1, 0.12, 0.08), (1, 1, 1)), mass=1.0)
    fine, coarse = sphere(radius=0.1, resolution=4), sphere(radius=0.105, resolution=2)
    ball = SoftBodyAsset(coarse, RUBBER, hull=(fine.vertices, fine.surface))
    cube = SoftBodyAsset(CUBE, RUBBER, spare_vertices=20)
    world.reserve(cube, 2)
    groups = []
    for x in (0.0, FAR):
        stack = [world.add_body(crate, position=(x, 0, 0.05 + 0.09 * i)) for i in range(3)]
        groups.append([*stack, world.add_body(ball, position=(x + 1, 0, 0.13))])
        groups[-1].append(world.add_body(cube, position=(x + 2, 0, 0.06)))
        slope = (np.sin(0.1), 0, 0, np.cos(0.1))
        world.add_collider(BoxShape((0.3, 0.3, 0.1)), position=(x + 4, 0, 0.4), rotation=slope)
        groups[-1].append(world.add_body(crate, position=(x + 4, 0, 0.6)))
    world.build()
    for step in range(150):
        world.step(DT)
        if step == 100:
            for x, group in zip((0.0, FAR), groups, strict=True):
                (piece,) = group[4].cut(plane=((x + 2.0, 0, 0), (1, 0, 0)))
                assert speed(group[4]) < 1e-3
                assert np.abs(piece.strains()).max() < 0.02
    for a, b in zip(*groups, strict=True):
        assert np.abs(b.center_of_mass() - a.center_of_mass() - (FAR, 0, 0)).max() < 0.01
        assert speed(b) <= 2.0 * speed(a) + 2e-3
    assert world.raycast((FAR + 0.99, 0, 5), (0, 0, -1)).body is groups[1][3]
