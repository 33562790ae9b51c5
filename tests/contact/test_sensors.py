"""Sensors: which bodies are in them, the events of these bodies, and what sensors leave alone."""

import numpy as np
import pytest
from experiments import turn

from taichi_soft import (
    BoxShape,
    CapsuleShape,
    Contact,
    ContactBegan,
    Entered,
    Event,
    HeightFieldShape,
    Left,
    Material,
    MeshShape,
    OptionError,
    PlaneShape,
    SoftBodyAsset,
    SphereShape,
    StateError,
    box,
    sphere,
)
from taichi_soft.world.bare import bare_world

G = 9.81
DT = 1 / 60
JELLY = Material(young=2e5, poisson=0.3, density=1000.0, damping_ratio=0.2)
BALL = SoftBodyAsset(sphere(radius=0.2, resolution=3), JELLY)
CRATE = SoftBodyAsset(box((0.6, 0.4, 0.3), (2, 2, 2)), JELLY)


def floating_world(**options):
    """Return an unbuilt world in which nothing falls and nothing touches."""
    return bare_world(**{"floor": None, "gravity": (0, 0, 0), "collider_room": 8, **options})


def told(events):
    """Kind, slot of the body and index of the sensor of each event."""
    return [(type(each).__name__, each.body.index, each.sensor.index) for each in events]


def test_who_is_in_a_box_or_a_sphere_is_who_touches_or_encloses_it():
    """The oracle is `overlap_box` and `overlap_sphere`, whose triangles are tested exactly.

    The crates have triangles larger than most of the sensors.
    """
    rng = np.random.default_rng(1)
    world = floating_world()
    for _ in range(12):
        axis = rng.normal(size=3)
        rotation = turn(rng.uniform(0, 3), axis / np.linalg.norm(axis))
        world.add_body(CRATE, position=rng.uniform(-0.5, 0.5, 3), rotation=rotation)
    world.build()
    counts = []
    for number in range(60):
        size, center = rng.uniform(0.02, 0.6, 3), rng.uniform(-0.8, 0.8, 3)
        axis = rng.normal(size=3)
        rotation = turn(rng.uniform(0, 3), axis / np.linalg.norm(axis))
        if number % 2:
            sensor = world.add_sensor(BoxShape(size), position=center, rotation=rotation)
            expected = world.overlap_box(center, size, rotation=rotation)
        else:
            sensor = world.add_sensor(SphereShape(size[0]), position=center)
            expected = world.overlap_sphere(center, size[0])
        found = [body.index for body in sensor.bodies_inside]
        assert found == [each.body.index for each in expected], number
        counts.append(len(found))
        sensor.remove()
    assert 0 in counts
    assert max(counts) > 4


CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * 0.25
CUBE_FACES = np.reshape([int(digit) for digit in "013032467475045051237276026064157173"], (-1, 3))


@pytest.mark.parametrize(
    ("shape", "distance"),
    [
        (PlaneShape(), lambda x: x[2]),
        (CapsuleShape(0.1, 1.0), lambda x: np.linalg.norm([x[0], x[1], max(abs(x[2]) - 0.5, 0)]) - 0.1),
        (HeightFieldShape(np.zeros((5, 5)), 0.5), lambda x: x[2]),
        (
            MeshShape((CUBE, CUBE_FACES), cell=0.04),
            lambda x: np.linalg.norm(np.maximum(np.abs(x) - 0.25, 0)) or -1,
        ),
    ],
)
def test_a_ball_is_in_any_shape_if_its_centre_is_nearer_than_its_radius(shape, distance):
    """The tolerance is that of a sphere of triangles, whose faces lie up to 9 % within it."""
    world = floating_world(sample_room=20_000)
    ball = world.add_body(BALL)
    world.build()
    sensor = world.add_sensor(shape)
    rng, decided, inside = np.random.default_rng(2), 0, 0
    for _ in range(60):
        place = rng.uniform(-0.7, 0.7, 3)
        away = distance(place)
        ball.teleport(place)
        if not 0.17 < away < 0.201:
            decided += 1
            inside += away < 0.17
            assert bool(sensor.bodies_inside) == (away < 0.17), place
    assert decided > 40
    assert 5 < inside < decided - 5


def points_on_faces(body, count):
    """Points of a grid with `count` intervals on each triangle of a body, and their largest spacing [m]."""
    i, j = np.mgrid[: count + 1, : count + 1]
    weights = np.stack([i, j, count - i - j], axis=-1)[i + j <= count] / count
    corners = body.positions().astype(np.float64)[body.surface]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    return np.einsum("wk,fkx->fwx", weights, corners).reshape(-1, 3), sides.max() / count


def test_a_thin_capsule_reports_crates_whose_faces_it_pierces_between_their_vertices():
    """The oracle is the distance of the capsule's axis from points on the crates' faces, 2 mm apart."""
    rng = np.random.default_rng(4)
    world = floating_world()
    crate = world.add_body(CRATE)
    world.build()
    points, spacing = points_on_faces(crate, 100)
    decided, inside = 0, 0
    for _ in range(60):
        radius, length, center = 0.02, 0.3, rng.uniform(-0.35, 0.35, 3)
        axis = rng.normal(size=3)
        rotation = turn(rng.uniform(0, 3), axis / np.linalg.norm(axis))
        sensor = world.add_sensor(CapsuleShape(radius, length), position=center, rotation=rotation)
        beside = (points - center) @ rotation
        beside[:, 2] -= np.clip(beside[:, 2], -0.5 * length, 0.5 * length)
        nearest = np.linalg.norm(beside, axis=1).min()
        is_enclosed = (np.abs(center) < [0.3, 0.2, 0.15]).all()
        if is_enclosed or not radius < nearest < radius + spacing:
            decided += 1
            inside += nearest <= radius
            assert bool(sensor.bodies_inside) == (is_enclosed or nearest <= radius), center
        sensor.remove()
    assert decided > 50
    assert inside > 10


def test_a_falling_ball_enters_and_leaves_when_its_lowest_and_highest_point_pass():
    """Free fall: z = z0 - g t^2 / 2 for the lowest and the highest vertex."""
    world = floating_world(gravity=(0, 0, -G), sleep_speed=0.02)
    ball = world.add_body(BALL, position=(0.0, 0.0, 3.0))
    world.build()
    # The sensor is a slab from 1 m to 2 m.
    gate = world.add_sensor(BoxShape((4.0, 4.0, 1.0)), position=(0.0, 0.0, 1.5))
    world.record_events([Entered, Left])
    heights = ball.positions()[:, 2].astype(np.float64)
    for _ in range(60):
        world.step(DT)
    entered, left = world.drain_events()
    assert told([entered, left]) == [("Entered", 0, gate.index), ("Left", 0, gate.index)]
    assert entered.sensor is gate
    assert entered.body is ball
    for event, fall in ((entered, heights.min() - 2.0), (left, heights.max() - 1.0)):
        passes = np.sqrt(2 * fall / G)
        assert passes - 1e-3 < event.time < passes + DT + 1e-3
        assert event.step == round(event.time / DT) - 1
    # It fell as if nothing were there.
    assert ball.center_of_mass()[2] == pytest.approx(3.0 - 0.5 * G * 1.0**2, rel=1e-3)
    np.testing.assert_array_equal(gate.impulse, np.zeros(3))


@pytest.fixture(scope="module")
def settled():
    """A built world: two crates sleep on the floor, the first within a sensor; a third is far away."""
    world = bare_world(floor=0.0, sleep_speed=0.05, collider_room=4, soft_contact=True)
    for x in (0.0, 1.0, 30.0):
        world.add_body(CRATE, position=(x, 0.0, 0.151))
    world.add_sensor(BoxShape((0.8, 0.8, 0.8)), position=(0.0, 0.0, 0.4))
    world.build()
    for _ in range(150):
        world.step(DT)
    assert all(body.is_asleep for body in world.bodies)
    world.record_events([Entered, Left])
    return world


@pytest.fixture
def sleepers(settled):
    kept = settled.snapshot()
    yield settled
    settled.restore(kept)
    settled.record_events([])
    settled.record_events([Entered, Left])


def test_a_sleeping_body_stays_inside_and_a_sensor_that_moves_wakes_nobody(sleepers):
    gate = sleepers.colliders[0]
    first, second, third = sleepers.bodies
    for _ in range(30):
        sleepers.step(DT)
    assert told(sleepers.drain_events()) == [("Entered", 0, gate.index)]
    assert gate.bodies_inside == (first,)
    gate.set_velocity((2.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    for _ in range(30):
        sleepers.step(DT)
    assert told(sleepers.drain_events()) == [("Entered", 1, gate.index), ("Left", 0, gate.index)]
    gate.teleport((30.0, 0.0, 0.4))
    assert gate.bodies_inside == (third,)
    gate.move_to((30.1, 0.0, 0.4))
    sleepers.step(DT)
    assert told(sleepers.drain_events()) == [("Entered", 2, gate.index), ("Left", 1, gate.index)]
    more = sleepers.add_sensor(SphereShape(5.0))
    assert more.bodies_inside == (first, second)
    gate.remove()
    sleepers.step(DT)
    assert told(sleepers.drain_events()) == [
        ("Entered", 0, more.index),
        ("Entered", 1, more.index),
        ("Left", 2, gate.index),
    ]
    assert all(body.is_asleep for body in sleepers.bodies)


def test_a_despawned_body_has_left_and_its_successor_has_entered(sleepers):
    gate, first = sleepers.colliders[0], sleepers.bodies[0]
    sleepers.step(DT)
    sleepers.drain_events()
    sleepers.despawn(first)
    second = sleepers.spawn(CRATE, position=(0.0, 0.0, 0.151))
    assert second.index == first.index
    sleepers.step(DT)
    entered, left = sleepers.drain_events()
    assert (entered.body, left.body) == (second, first)
    assert gate.bodies_inside == (second,)


def test_rewinding_sends_the_same_events_again(sleepers):
    gate, first = sleepers.colliders[0], sleepers.bodies[0]
    sleepers.step(DT)
    sleepers.drain_events()
    kept = sleepers.snapshot()

    def play():
        first.set_velocity((3.0, 0.0, 3.0))
        for step in range(50):
            if step == 30:
                gate.teleport((1.0, 0.0, 0.4))
            sleepers.step(DT)
        return [(*each, event.step) for each, event in _with_steps(sleepers.drain_events())]

    expected = play()
    assert [each[0] for each in expected].count("Left") >= 1
    sleepers.restore(kept)
    assert play() == expected
    assert gate.is_sensor


def _with_steps(events):
    return zip(told(events), events, strict=True)


def test_groups_and_masks_choose_whom_a_sensor_reports():
    world = floating_world()
    filters = [(1, 1), (2, 1), (1, 2), (3, 6), (2, 2)]
    for group, mask in filters:
        asset = SoftBodyAsset(CRATE.mesh, JELLY, contact=Contact(group=group, mask=mask))
        world.add_body(asset)
    world.build()
    sensor = world.add_sensor(SphereShape(1.0), group=1, mask=3)
    expected = [i for i, (group, mask) in enumerate(filters) if group & 3 and mask & 1]
    assert [body.index for body in sensor.bodies_inside] == expected


def test_a_body_moves_to_the_same_bits_with_and_without_a_sensor_around_it():
    def play(senses):
        world = bare_world(floor=0.0, collider_room=8)
        ball = world.add_body(BALL, position=(0.0, 0.0, 0.4), velocity=(1.0, 0.0, 0.0))
        world.build()
        if senses:
            world.add_sensor(BoxShape((1.0, 1.0, 1.0)), position=(0.3, 0.0, 0.3)).set_velocity((1.0, 0, 0))
            world.record_events([Event])
        for _ in range(40):
            world.step(DT)
        return ball.positions()

    np.testing.assert_array_equal(play(False), play(True))


def test_what_is_no_sensor_is_refused(sleepers):
    wall = sleepers.add_collider(PlaneShape(), group=0)
    with pytest.raises(StateError, match="is no sensor"):
        _ = wall.bodies_inside
    gate = sleepers.colliders[0]
    assert gate.is_sensor
    assert not wall.is_sensor
    with pytest.raises(OptionError, match="shape"):
        sleepers.add_sensor("box")
    wall.remove()
    flat = bare_world(floor=0.0, schedule="flat")
    flat.add_body(CRATE, position=(0, 0, 1))
    flat.build()
    with pytest.raises(StateError):
        flat.on(Entered, print)
    with pytest.raises(StateError):
        flat.add_sensor(SphereShape(1.0))


def test_a_sensor_has_no_contact_events(sleepers):
    sleepers.record_events([Event])
    sleepers.bodies[0].apply_impulse((0.0, 0.0, 30.0))
    for _ in range(60):
        sleepers.step(DT)
    touched = [each.b for each in sleepers.drain_events() if isinstance(each, ContactBegan)]
    assert touched
    assert sleepers.colliders[0] not in touched
