"""Changes of gravity and friction at run time: closed forms, woken bodies, and snapshots."""

import numpy as np
import pytest

from taichi_soft import (
    BoxShape,
    Contact,
    Material,
    OptionError,
    SoftBodyAsset,
    StateError,
    box,
)
from taichi_soft.render.replay import replay
from taichi_soft.world.bare import bare_world

G, DT = 9.81, 1 / 60
FIRM = Material(young=1e6, poisson=0.2, density=1000.0, damping=300.0, damping_ratio=0.0)
SLOPE = 0.3
DOWN = G * np.array([np.sin(SLOPE), 0.0, -np.cos(SLOPE)])
"""Gravity of a world that leans: what is level in it goes down along +x."""


def run(world, seconds):
    for _ in range(round(seconds * 60)):
        world.step(DT)


def way(body):
    return body.center_of_mass()[0]


def slide(world, *bodies):
    """Acceleration of each along x, from the second difference of its way in the second from 0.25 s on."""
    ways = []
    for seconds in (0.25, 0.5, 0.5):
        run(world, seconds)
        ways.append([way(body) for body in bodies])
    return np.diff(ways, 2, axis=0)[0] / 0.5**2


def book(share):
    """Acceleration of a block on the slope, of which friction is a share of the tangent."""
    return max(0.0, 1.0 - share) * G * np.sin(SLOPE)


@pytest.mark.parametrize(
    "options",
    [
        {"integrator": "leapfrog"},
        pytest.param({"integrator": "lazy_leapfrog"}, marks=pytest.mark.soak),
        pytest.param({"integrator": "implicit_euler"}, marks=pytest.mark.soak),
        pytest.param({"schedule": "flat"}, marks=pytest.mark.soak),
    ],
    ids=lambda options: next(iter(options.values())),
)
def test_a_free_fall_goes_on_by_the_gravity_that_was_set(options):
    """x = g t^2/2, then + v t + g' t^2/2, and on by the first gravity, to half a substep of each change.

    The energy is - m g x of the current gravity.
    """
    world = bare_world(floor=None, **options)
    body = world.add_body(box(cells=(2, 2, 2)), FIRM)
    world.build()
    x, v, t, half = np.zeros(3), np.zeros(3), 0.25, 0.5 * DT / 16
    first, close = world.settings.gravity, 1e-4
    for gravity in (first, np.array([3.0, -1.0, 2.0]), first):
        world.set_gravity(gravity)
        for _ in range(15):
            world.step(DT, 16)
        x, v = x + v * t + gravity * t**2 / 2, v + gravity * t
        close += 1.1 * half * (np.linalg.norm(gravity - first) + G)  # leapfrog, and the order of the others
        assert world.settings.gravity.tolist() == gravity.tolist()
        np.testing.assert_allclose(body.velocities(), np.tile(v, (27, 1)), atol=close)
        np.testing.assert_allclose(body.center_of_mass(), x, atol=close * world.time)
        energy = -body.masses.sum() * gravity @ body.center_of_mass()
        assert body.gravitational_energy() == pytest.approx(energy, rel=1e-5)


@pytest.mark.parametrize("integrator", ["leapfrog", pytest.param("implicit_euler", marks=pytest.mark.soak)])
def test_a_block_slides_on_the_floor_where_its_friction_is_below_the_tangent(integrator):
    """Without colliders: at rest above the tangent, g (sin a - mu cos a) below it, and at rest again."""
    world = bare_world(gravity=DOWN, friction=2 * np.tan(SLOPE), integrator=integrator)
    body = world.add_body(box((1.0, 1.0, 0.5), (2, 2, 1)), FIRM, position=(0, 0, 0.25))
    world.build()
    run(world, 1.0)
    assert slide(world, body) == pytest.approx(0.0, abs=1e-3)
    world.set_friction(0.5 * np.tan(SLOPE))
    assert slide(world, body) == pytest.approx(book(0.5), rel=0.02)
    world.set_friction(0.0)
    assert slide(world, body) == pytest.approx(book(0.0), rel=0.02)
    world.set_friction(4 * np.tan(SLOPE))
    run(world, 2.0)
    start = way(body)
    run(world, 0.5)
    assert way(body) == pytest.approx(start, abs=1e-3)


@pytest.mark.parametrize("integrator", ["leapfrog", pytest.param("implicit_euler", marks=pytest.mark.soak)])
def test_a_world_built_with_other_gravity_and_friction_goes_on_from_a_snapshot(integrator):
    def made(**options):
        world = bare_world(integrator=integrator, **options)
        world.add_body(box(cells=(1, 1, 1)), FIRM, position=(0, 0, 0.5), velocity=(1, 0, 0))
        world.build()
        return world

    world = made(gravity=(0, 0, -3.0), friction=0.9)
    run(world, 0.2)
    world.set_gravity((0.5, 0, -5.0))
    world.set_friction(0.1)
    data = world.snapshot()
    run(world, 0.5)
    name, velocities = world.state_hash(), world.bodies[0].velocities().tobytes()
    del world  # the next world reuses its kernels
    world = made()
    world.restore(data)
    assert world.settings.gravity.tolist() == [0.5, 0, -5.0]
    assert world.settings.friction == 0.1
    assert world.snapshot() == data
    run(world, 0.5)
    assert (world.state_hash(), world.bodies[0].velocities().tobytes()) == (name, velocities)


@pytest.mark.parametrize("soft_contact", [False, True])
def test_before_build_a_world_is_built_with_what_was_set(soft_contact):
    """A block on the slope of 0.3, whose friction would hold it: it slides by g sin a."""
    world = bare_world(soft_contact=soft_contact)
    world.set_gravity(DOWN)
    world.set_friction(0.0)
    body = world.add_body(box((1.0, 1.0, 0.5), (2, 2, 1)), FIRM, position=(0, 0, 0.25))
    with pytest.raises(StateError, match="build"):
        body.set_friction(0.1)
    world.build()
    assert world.settings.gravity.tolist() == DOWN.tolist()
    assert slide(world, body) == pytest.approx(book(0.0), rel=0.02)
    assert world.floor_collider is not None


def touching(spare_vertices=0, cells=(), **options):
    """A world with soft contact and a pool of three cubes of friction 0.4."""
    world = bare_world(soft_contact=True, **options)
    cube = SoftBodyAsset(
        box(cells=(2, 2, 2)), FIRM, contact=Contact(friction=0.4), spare_vertices=spare_vertices
    )
    cube = cube.with_coarser(*(box(cells=each) for each in cells))
    world.reserve(cube, 3)
    world.build()
    return world, cube


def frictions_of(world):
    """Return the friction of each slot: the body's property, and the value that contact reads."""
    rows = world._built.state.body_surface.to_numpy()[: world.slot_count, 0]
    return {body.index: (body.friction, pytest.approx(float(rows[body.index]))) for body in world.bodies}


def same(numbers):
    return {slot: (number, pytest.approx(number)) for slot, number in numbers.items()}


def test_pieces_have_the_friction_of_their_body_and_who_comes_next_that_of_its_asset():
    world, loaf = touching(spare_vertices=40)
    whole = world.spawn(loaf, position=(0, 0, 3))
    whole.set_friction(0.1)
    uncut = world.snapshot()
    pieces = whole.cut(plane=((0, 0, 3.01), (0, 0, 1)))
    assert len(pieces) == 1
    cut = world.snapshot()
    assert frictions_of(world) == same({0: 0.1, 1: 0.1})
    pieces[0].set_friction(0.2)
    world.restore(cut)
    assert frictions_of(world) == same({0: 0.1, 1: 0.1})
    world.restore(uncut)
    assert frictions_of(world) == same({0: 0.1})
    for _ in range(2):
        guest = world.spawn(loaf, position=(0, 3, 3))
        assert frictions_of(world) == same({0: 0.1, 1: 0.4})
        guest.set_friction(0.2)
        world.restore(uncut)
    world.restore(cut)
    assert frictions_of(world) == same({0: 0.1, 1: 0.1})
    for body in world.bodies:
        world.despawn(body)
    assert whole.friction == 0.4
    world.spawn(loaf, position=(0, 0, 3))
    world.spawn(loaf, position=(0, 3, 3))
    assert frictions_of(world) == same({0: 0.4, 1: 0.4})
    world.restore(uncut)
    assert frictions_of(world) == same({0: 0.1})
    assert world.bodies == (whole,)


def test_another_level_of_detail_has_the_friction_that_was_set():
    world, ball = touching(cells=[(1, 1, 1)])
    body = world.spawn(ball, position=(0, 0, 3))
    body.set_friction(0.1)
    fine = world.snapshot()
    body.set_level(1)
    assert frictions_of(world) == same({0: 0.1})
    coarse = world.snapshot()
    body.set_friction(0.4)
    body.set_level(0)
    assert frictions_of(world) == same({0: 0.4})
    for data in (coarse, fine, coarse):
        world.restore(data)
        assert frictions_of(world) == same({0: 0.1})


def test_a_recording_makes_it_again_to_the_bit(tmp_path):
    world, cube = touching(record=100)
    for height in (0.51, 1.6):
        world.spawn(cube, position=(0, 0, height), velocity=(height, 0, 0))
    for step in range(6):
        world.set_gravity((0, 0.1 * step, -5.0 - step))
        world.set_friction(0.1 * step)
        world.bodies[1].set_friction(0.05 * step)
        run(world, 0.1)
    name, path = world.state_hash(), world.save_recording(tmp_path / "it.recording")
    del world  # the next world reuses its kernels
    report = replay(path)
    assert report.first_difference is None
    assert report.world.state_hash() == name
    assert report.world.settings.gravity.tolist() == [0, 0.5, -10.0]
    assert report.world.bodies[1].friction == 0.25


@pytest.fixture(scope="module")
def leaning():
    """A slope with three blocks that sleep: on the floor, on a box, on a plate that is a body."""
    world = bare_world(
        gravity=DOWN, friction=2 * np.tan(SLOPE), soft_contact=True, sleep_speed=0.02, collider_room=1
    )
    block = SoftBodyAsset(box((0.4, 0.4, 0.2), (2, 2, 1)), FIRM, contact=Contact(2 * np.tan(SLOPE)))
    plate = box((8.0, 0.8, 0.2), (16, 2, 1))
    shelf = world.add_collider(BoxShape((60.0, 2.0, 0.5)), position=(0, 5, 0.25), friction=2 * np.tan(SLOPE))
    on_floor = world.add_body(block, position=(0, 0, 0.1))
    on_shelf = world.add_body(block, position=(0, 5, 0.6))
    fixed = world.add_body(
        plate,
        FIRM,
        position=(3, -5, 0.5),
        pinned=np.arange(len(plate.vertices)),
        contact=Contact(2 * np.tan(SLOPE)),
    )
    skin = 0.5 * (block.surface_row[1] + fixed.asset.surface_row[1])
    on_plate = world.add_body(block, position=(0, -5, 0.7 + skin))
    world.build()
    bodies = (on_floor, on_shelf, on_plate)
    while world.time < 5.0 and not all(body.is_asleep for body in bodies):
        world.step(DT)
    return world, shelf, fixed, bodies, world.snapshot()


@pytest.fixture
def slope(leaning):
    world, *others, data = leaning
    world.restore(data)
    assert [body.is_asleep for body in world.bodies] == [True] * 4
    return world, *others


@pytest.mark.parametrize("surface", ["floor", "shelf", "plate"])
def test_who_lies_on_what_grows_slippery_wakes_and_slides_as_coulomb_has_it(slope, surface):
    """g (sin a - mu cos a) there, and rest elsewhere. Between bodies the geometric mean counts."""
    world, shelf, plate, bodies = slope
    mu, number = 0.5 * np.tan(SLOPE), ["floor", "shelf", "plate"].index(surface)
    starts = [way(body) for body in bodies]
    if surface == "floor":
        world.set_friction(mu)
        assert world.settings.friction == world.floor_collider.friction == mu
    elif surface == "shelf":
        shelf.set_friction(mu)
        assert (shelf.friction, world.floor_collider.friction) == (mu, 2 * np.tan(SLOPE))
    else:
        plate.set_friction(mu**2 / bodies[2].friction)
        assert plate.friction == pytest.approx(0.125 * np.tan(SLOPE))
    found = slide(world, *bodies)
    for i, body in enumerate(bodies):
        if i == number:
            assert found[i] == pytest.approx(book(0.5), rel=0.03)
        else:
            assert way(body) == pytest.approx(starts[i], abs=1e-3)


def test_less_friction_that_still_holds_wakes_who_lies_there_and_moves_nobody(slope):
    world, shelf, plate, bodies = slope
    shelf.set_friction(1.5 * np.tan(SLOPE))
    assert [body.is_asleep for body in bodies] == [True, False, True]
    plate.set_friction(1.9 * np.tan(SLOPE))
    world.step(DT)
    assert [body.is_asleep for body in bodies] == [True, False, False]
    starts = [way(body) for body in bodies]
    run(world, 1.0)
    assert [way(body) for body in bodies] == pytest.approx(starts, abs=1e-4)


def test_gravity_that_turns_wakes_all_and_they_leave_the_slope(slope):
    world, *_, bodies = slope
    world.set_gravity((0, 0, 5.0))
    assert not any(body.is_asleep for body in world.bodies)
    heights = np.array([body.center_of_mass()[2] for body in bodies])
    for _ in range(30):
        world.step(DT)
    risen = np.array([body.center_of_mass()[2] for body in bodies]) - heights
    assert risen == pytest.approx(0.5 * 5.0 * 0.5**2, rel=0.02)


def test_the_value_that_there_is_wakes_nobody_and_changes_nothing(slope):
    world, shelf, plate, _ = slope
    before = world.snapshot()
    world.set_gravity(list(world.settings.gravity))
    world.set_friction(world.settings.friction)
    shelf.set_friction(shelf.friction)
    plate.set_friction(plate.friction)
    assert world.snapshot() == before


def test_restore_undoes_to_the_bit_what_was_set_since(slope):
    world, shelf, plate, _ = slope
    world.wake()
    data, names = world.snapshot(), [world.state_hash()]
    run(world, 0.2)
    later = world.state_hash()
    world.restore(data)
    for call in (
        lambda: world.set_gravity((0, 1, -3)),
        lambda: world.set_friction(0.01),
        lambda: shelf.set_friction(0.02),
        lambda: plate.set_friction(0.03),
    ):
        call()
        names.append(world.state_hash())
    assert len(set(names)) == 5
    changed = world.snapshot()
    run(world, 0.2)
    other = world.state_hash()
    world.restore(data)
    assert (world.snapshot(), world.state_hash()) == (data, names[0])
    assert world.settings.gravity.tolist() == DOWN.tolist()
    frictions = [world.settings.friction, world.floor_collider.friction, shelf.friction, plate.friction]
    assert frictions == [2 * np.tan(SLOPE)] * 4
    run(world, 0.2)
    assert world.state_hash() == later
    world.restore(changed)
    frictions = [world.settings.friction, world.floor_collider.friction, shelf.friction, plate.friction]
    assert frictions == [0.01, 0.01, 0.02, 0.03]
    run(world, 0.2)
    assert world.state_hash() == other


def test_a_floor_that_is_a_collider_tells_the_world_what_it_was_given(slope):
    world, *_ = slope
    world.floor_collider.set_friction(0.07)
    assert world.settings.friction == 0.07


def test_where_there_is_nothing_to_set_it_is_refused_and_says_where_it_is(slope):
    with pytest.raises(StateError, match=r"no floor.*Collider.set_friction.*Body.set_friction"):
        bare_world(floor=None).set_friction(0.1)
    world = bare_world()
    body = world.add_body(box(cells=(1, 1, 1)), FIRM, position=(0, 0, 0.5))
    world.build()
    with pytest.raises(StateError, match=r"soft_contact.*World.set_friction"):
        body.set_friction(0.1)
    world = slope[0]
    data = world.snapshot()
    removed = world.add_collider(BoxShape((1, 1, 1)), position=(0, 0, 9), friction=0.3)
    removed.remove()
    with pytest.raises(StateError, match="removed"):
        removed.set_friction(0.1)
    world.floor_collider.remove()
    with pytest.raises(StateError, match="removed"):
        world.set_friction(0.1)
    assert world.settings.friction == 2 * np.tan(SLOPE)
    world.restore(data)


@pytest.mark.parametrize("bad", [-0.1, 1e7, float("nan"), "ice", None])
def test_a_friction_out_of_range_changes_nothing(slope, bad):
    world, shelf, plate, _ = slope
    before = world.snapshot()
    for call in (world.set_friction, shelf.set_friction, plate.set_friction):
        with pytest.raises(OptionError, match=r"friction.*0 to 1,000,000"):
            call(bad)
    assert world.snapshot() == before


@pytest.mark.parametrize("bad", [(0, 0), -9.81, (0, 0, float("nan")), (0, 0, -1e39), "down"])
def test_a_gravity_out_of_reach_changes_nothing(slope, bad):
    world, *_ = slope
    before = world.snapshot()
    with pytest.raises(OptionError, match="gravity"):
        world.set_gravity(bad)
    assert world.snapshot() == before
