"""Edges and faces of bodies on the edges and thin parts of colliders, where no vertex of a body is near."""

import numpy as np
import pytest

from taichi_soft import (
    BoxShape,
    CapsuleShape,
    Contact,
    Material,
    OptionError,
    SoftBodyAsset,
    SpringMaterial,
    box,
    cloth,
    cloth_constants,
    rope,
    sphere,
)
from taichi_soft.world.bare import bare_world

DT = 1 / 60
RUBBER = Material(young=3e5, poisson=0.3, density=1000.0, damping_ratio=0.2)
HARD = Material(young=5e7, poisson=0.3, density=1000.0, damping_ratio=0.2)
WALL = np.array([0.5, 0.3, 0.01])  # half of the edges of a wall of 2 cm [m]
ABOUT_Y = (0, np.sin(np.pi / 8), 0, np.cos(np.pi / 8))  # 45 degrees


def matrix(q):
    """Rotation matrix of a unit quaternion (x, y, z, w)."""
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def points_of(body, count=12):
    """Points on all triangles of a body, or on all edges of a rope, (n, 3) [m]."""
    x = body.positions().astype(np.float64)
    if not len(body.surface):
        t = np.linspace(0.0, 1.0, 4 * count)[:, None, None]
        ends = x[np.asarray(body.mesh.edges)]
        return ((1.0 - t) * ends[:, 0] + t * ends[:, 1]).reshape(-1, 3)
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij"))
    weights = np.stack([i, j, count - i - j], axis=1)[i + j <= count] / count
    return np.einsum("wk,fka->fwa", weights, x[body.surface]).reshape(-1, 3)


def depth_in_box(points, half, center=(0, 0, 0), turn=None):
    """Largest depth of points in a box [m]."""
    beside = (points - np.asarray(center)) @ (np.eye(3) if turn is None else turn)
    return max(0.0, float((half - np.abs(beside)).min(axis=1).max()))


def depth_in_capsule(points, radius, length, center=(0, 0, 0), turn=None):
    """Largest depth of points in a capsule along z [m]."""
    beside = (points - np.asarray(center)) @ (np.eye(3) if turn is None else turn)
    beside[:, 2] -= np.clip(beside[:, 2], -0.5 * length, 0.5 * length)
    return max(0.0, radius - float(np.linalg.norm(beside, axis=1).min()))


def add_two_edges(world):
    for x in (-0.27, 0.23):
        world.add_collider(BoxShape((0.2, 1, 0.2)), position=(x, 0, -0.1 * np.sqrt(2.0)), rotation=ABOUT_Y)
    return box((1.0, 0.1, 0.1), (4, 1, 1))


def add_two_rims(world):
    for x in (-0.27, 0.23):
        world.add_collider(BoxShape((0.15, 1, 0.2)), position=(x, 0, -0.1))
    return box((1.0, 0.1, 0.1), (2, 1, 1))


def add_three_pins(world):
    for x, y in ((-0.13, -0.1), (0.14, -0.11), (0.01, 0.13)):
        world.add_collider(CapsuleShape(radius=0.01, length=0.2), position=(x, y, -0.11))
    return box((0.5, 0.5, 0.1), (2, 2, 1))


def add_post(world):
    world.add_collider(BoxShape((0.2, 0.2, 0.2)), position=(0, 0, -0.1))
    return box((0.6, 0.6, 0.1), (1, 1, 1))


SUPPORTS = [add_two_edges, add_two_rims, add_three_pins, add_post]


@pytest.mark.parametrize("add", SUPPORTS)
def test_supports_between_vertices_carry_the_weight_and_the_body_falls_asleep(add):
    world = bare_world(floor=None, sleep_speed=0.02)
    body = world.add_body(add(world), RUBBER, position=(0, 0, 0.06))
    world.build()
    for _ in range(300):
        world.step(DT)
        force = np.sum([np.array(c.impulse) for c in world.colliders], axis=0) / DT
        if body.is_asleep:
            break
    weight = 9.81 * body.masses.sum()
    assert body.is_asleep
    # Friction can hold a body that still sways a little when it falls asleep.
    assert force == pytest.approx([0, 0, -weight], abs=0.03 * weight)
    torque = np.sum(
        [
            np.array(c.angular_impulse) + np.cross(np.array(c.position), np.array(c.impulse))
            for c in world.colliders
        ],
        axis=0,
    )
    expected = np.cross(body.center_of_mass(), [0, 0, -weight])
    assert torque / DT == pytest.approx(expected, abs=0.01 * weight)


def test_without_faces_only_vertices_touch_colliders():
    """A plate with vertices at its corners only falls past a post under its middle."""
    world = bare_world(floor=-0.5)
    body = world.add_body(add_post(world), RUBBER, position=(0, 0, 0.06), contact=Contact(faces=False))
    world.build()
    for _ in range(120):
        world.step(DT)
    assert body.positions()[:, 2].min() == pytest.approx(-0.5, abs=1e-3)
    with pytest.raises(OptionError, match=r"leave out Contact\(faces=False\)"):
        SoftBodyAsset(rope(1.0, 4, 0.2), SpringMaterial(1e3), contact=Contact(faces=False))


def test_a_body_without_sleep_comes_to_rest_on_edges():
    world = bare_world(floor=None)
    body = world.add_body(add_two_edges(world), RUBBER, position=(0, 0, 0.06))
    world.build()
    forces = []
    for step in range(300):
        world.step(DT)
        if step >= 240:
            forces.append(sum(c.impulse[2] for c in world.colliders) / DT)
    weight = 9.81 * body.masses.sum()
    assert np.abs(body.velocities()).max() < 5e-3
    assert -np.array(forces) == pytest.approx(np.full(60, weight), rel=0.01)


def random_encounter(rng, speed, material):
    """A random body thrown at a random place of a thin wall or of a pin.

    Returns: world, body, and the function that measures the depth of points in the collider [m].
    """
    world = bare_world(gravity=(0, 0, 0), floor=None)
    turn = rng.normal(size=4)
    turn /= np.linalg.norm(turn)
    axes = matrix(turn)
    if rng.integers(2):
        world.add_collider(BoxShape(2 * WALL), rotation=turn, friction=0.3)
        target = axes @ (WALL * [1, 1, 0] * rng.choice([-1, 1], 3) * rng.uniform(0, 1, 3))

        def depth(points):
            return depth_in_box(points, WALL, turn=axes)
    else:
        radius = 10 ** rng.uniform(-2.5, -1)
        world.add_collider(CapsuleShape(radius=radius, length=0.6), rotation=turn, friction=0.3)
        target = axes @ [0, 0, rng.uniform(-0.3, 0.3)]

        def depth(points):
            return depth_in_capsule(points, radius, 0.6, turn=axes)

    meshes = (
        box((0.6, 0.4, 0.2), (2, 2, 1)),
        box((1.0, 0.1, 0.1), (4, 1, 1)),
        sphere(radius=0.25, resolution=2),
    )
    way, own = rng.normal(size=3), rng.normal(size=4)
    way /= np.linalg.norm(way)
    body = world.add_body(
        meshes[rng.integers(3)],
        material,
        position=target - 1.2 * way,
        rotation=own / np.linalg.norm(own),
        velocity=speed * way,
    )
    world.build()
    return world, body, depth


@pytest.mark.parametrize(("material", "slowest", "fastest"), [(RUBBER, 1.0, 5.0), (HARD, 20.0, 100.0)])
def test_no_part_of_a_body_enters_a_thin_collider(material, slowest, fastest):
    rng = np.random.default_rng(5)
    for _ in range(12):
        speed = np.exp(rng.uniform(np.log(slowest), np.log(fastest)))
        world, body, depth = random_encounter(rng, speed, material)
        energy = body.kinetic_energy()
        dt = min(DT, 0.1 / speed)
        for _ in range(int(2.5 / (speed * dt))):
            world.step(dt)
            assert depth(points_of(body)) < 4e-3
        assert not body.is_frozen
        assert body.kinetic_energy() < 1.001 * energy


def test_a_rim_of_2_cm_stops_a_body_at_100_m_per_s():
    world = bare_world(gravity=(0, 0, 0), floor=None)
    # The rim is a third of the way between the vertices of the face that hits it.
    world.add_collider(BoxShape((1.0, 2.0, 0.02)), position=(-0.5, 0, 0.033))
    body = world.add_body(box((0.2, 0.4, 0.4), (1, 2, 2)), HARD, position=(1, 0, 0), velocity=(-100, 0, 0))
    world.build()
    for _ in range(60):
        world.step(1 / 1000)
        assert depth_in_box(points_of(body), [0.5, 1.0, 0.01], (-0.5, 0, 0.033)) < 2e-3
    assert body.center_of_mass()[0] > 0.05
    assert not body.is_frozen


def test_the_reaction_on_a_collider_equals_the_change_of_momentum():
    world = bare_world(gravity=(0, 0, 0), floor=None)
    wall = world.add_collider(BoxShape((1.0, 2.0, 0.04)), position=(-0.5, 0.1, 0.03), friction=0.4)
    body = world.add_body(
        box((0.2, 0.4, 0.4), (1, 2, 2)), RUBBER, position=(0.2, 0, 0), velocity=(-4, 1, 0.5)
    )
    world.build()
    momentum, turn = body.momentum(), body.angular_momentum()
    impulse, moment = np.zeros(3), np.zeros(3)
    for _ in range(30):
        world.step(DT)
        impulse += wall.impulse
        moment += wall.angular_impulse + np.cross(wall.position, wall.impulse)
    size = np.linalg.norm(momentum)
    assert np.linalg.norm(impulse) > size  # it bounced
    assert body.momentum() - momentum == pytest.approx(-impulse, abs=2e-6 * size)
    assert body.angular_momentum() - turn == pytest.approx(-moment, abs=2e-6 * size)


def test_a_bar_slides_on_an_edge_with_coulomb_friction():
    friction, slope = 0.3, np.radians(30.0)
    world = bare_world(floor=None)
    # Two edges along x, tilted about y, 0.1 m apart. The bar is along y, between its vertices on each edge.
    tilt = np.array([0, np.sin(slope / 2), 0, np.cos(slope / 2)])
    half = np.array([np.sin(np.pi / 8), 0, 0, np.cos(np.pi / 8)])
    turn = np.array(
        [
            tilt[3] * half[0],
            tilt[1] * half[3],
            -tilt[1] * half[0],
            tilt[3] * half[3],
        ]
    )
    down = np.array([np.cos(slope), 0, -np.sin(slope)])
    up = np.array([np.sin(slope), 0, np.cos(slope)])
    for y in (-0.13, 0.12):
        center = np.array([0, y, 0]) - 0.1 * np.sqrt(2.0) * up
        world.add_collider(BoxShape((6.0, 0.2, 0.2)), position=center, rotation=turn, friction=friction)
    body = world.add_body(
        box((0.1, 0.5, 0.1), (1, 1, 1)), HARD, position=0.0505 * up - 1.5 * down, rotation=tilt
    )
    world.build()
    for _ in range(12):  # land
        world.step(DT)
    begin = body.momentum() @ down / body.masses.sum()
    for _ in range(30):
        world.step(DT)
    gained = body.momentum() @ down / body.masses.sum() - begin
    expected = 9.81 * (np.sin(slope) - friction * np.cos(slope)) * 30 * DT
    assert gained == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("restitution", [0.2, 0.4])
def test_restitution_of_an_edge_limits_the_rebound(restitution):
    world = bare_world(gravity=(0, 0, 0), floor=None)
    world.add_collider(
        BoxShape((0.2, 1, 0.2)),
        position=(0, 0, -0.1 * np.sqrt(2.0)),
        rotation=ABOUT_Y,
        restitution=restitution,
    )
    body = world.add_body(
        box((0.5, 0.1, 0.1), (5, 1, 1)), RUBBER, position=(0.01, 0, 0.1), velocity=(0, 0, -3)
    )
    world.build()
    fastest = 0.0
    for _ in range(60):
        world.step(DT)
        fastest = max(fastest, body.momentum()[2] / body.masses.sum())
    assert 2 * restitution < fastest < 1.1 * 3 * restitution


def test_a_rope_hangs_over_a_peg_between_its_vertices():
    world = bare_world(floor=None)
    world.add_collider(
        CapsuleShape(radius=0.01, length=0.6), rotation=(np.sqrt(0.5), 0, 0, np.sqrt(0.5)), friction=0.5
    )
    body = world.add_body(
        rope(1.0, 5, 0.2),
        SpringMaterial(2000.0, 0.5),
        position=(0.02, 0.0, 0.03),
        contact=Contact(thickness=0.01),
    )
    world.build()
    for _ in range(120):
        world.step(DT)
        assert (
            depth_in_capsule(points_of(body), 0.01, 0.6, turn=matrix((np.sqrt(0.5), 0, 0, np.sqrt(0.5))))
            < 1e-3
        )
    assert points_of(body)[:, 2].max() > 0


def test_cloth_does_not_enter_the_corner_of_a_box():
    world = bare_world(floor=0.0)
    world.add_collider(BoxShape((0.5, 0.5, 0.5)), position=(0, 0, 0.5))
    cells = 16, 16
    mesh = cloth((1.2, 1.2), cells, mass=0.43)
    springs = SpringMaterial(cloth_constants(mesh, cells, tensile=400.0, shear=100.0, bend=2.0), damping=0.05)
    body = world.add_body(mesh, springs, position=(0.3, 0.3, 1.05), contact=Contact(thickness=0.01))
    world.build()
    for step in range(90):
        world.step(DT)
        if step % 3 == 0:
            assert depth_in_box(points_of(body, 6), [0.25] * 3, (0, 0, 0.5)) < 2e-3


def test_a_snapshot_on_edges_continues_with_the_same_bits():
    world = bare_world(floor=None)
    body = world.add_body(add_three_pins(world), RUBBER, position=(0, 0, 0.06))
    world.build()
    for _ in range(20):
        world.step(DT)
    kept = world.snapshot()
    ends = []
    for _ in range(2):
        world.restore(kept)
        for _ in range(20):
            world.step(DT)
        ends.append(body.positions())
    assert (ends[0] == ends[1]).all()
