"""Bodies that cannot come into a world, or that cannot leave it: refused, and nothing changes."""

import pytest

from taichi_soft import Material, OptionError, SoftBodyAsset, StateError, box, sphere
from taichi_soft.world.bare import bare_world

JELLY = Material(1e5, 0.2, 1000.0, 20.0)
MESH = box(cells=(2, 2, 2))


def cube():
    return SoftBodyAsset(MESH, JELLY)


@pytest.fixture(scope="module")
def play():
    """Return a built world with two pools of three."""
    world = bare_world(floor=None)
    kinds = (cube(), SoftBodyAsset(sphere(0.5, 2), JELLY))
    for kind in kinds:
        world.reserve(kind, 3)
    world.build()
    return world, kinds


def state_of(world):
    fields = ("particle_position", "particle_velocity", "prev_position", "particle_inv_mass", "body_status")
    rows = [getattr(world._built.state, name).to_numpy().tobytes() for name in fields]
    return rows, world.bodies, world.step_count, world.is_built


NAN = float("nan")
SPAWNS = {
    "nan": ({"position": (0, 0, NAN)}, "position must be finite"),
    "shape": ({"position": (0, 0)}, "position must have shape"),
    "far": ({"position": (9.9999999e6, 0, 0)}, "beyond 1e[+]07 m"),
    "crooked": ({"rotation": (0, 0, 0, 2)}, "length 2: normalise"),
    "fast": ({"velocity": (0, 2e4, 0)}, "velocity must lie within"),
    "whirling": ({"angular_velocity": (0, 5e4, 0)}, "angular_velocity=.* a vertex .* m/s"),
    "whirling nan": ({"angular_velocity": (0, NAN, 0)}, "angular_velocity must be finite"),
    "on no floor": ({"on_floor": True}, r"no floor: make it with World\(floor=0.0\)"),
    "on floor text": ({"on_floor": "yes"}, "on_floor must be"),
    "spinning text": ({"angular_velocity": "fast"}, "angular_velocity must be numbers"),
}


@pytest.mark.parametrize("name", SPAWNS)
def test_a_body_that_cannot_begin_so_is_refused_and_nothing_changes(empty, name):
    world, (kind, _) = empty
    world.spawn(kind)
    options, message = SPAWNS[name]
    before = state_of(world)
    with pytest.raises(OptionError, match=message):
        world.spawn(kind, **options)
    assert state_of(world) == before
    assert world.spawn(kind).index == 1  # the slot is still free


@pytest.mark.parametrize("value", [None, MESH, "cube", 0, SoftBodyAsset])
def test_what_is_no_asset_is_refused(empty, value):
    world, _ = empty
    before = state_of(world)
    with pytest.raises(OptionError, match=r"asset.*SoftBodyAsset"):
        world.spawn(value)
    with pytest.raises(OptionError, match=r"asset.*SoftBodyAsset"):
        bare_world().reserve(value, 1)
    assert state_of(world) == before


def test_a_full_pool_an_unknown_asset_and_a_late_reserve_are_refused(empty):
    world, (kind, other) = empty
    bodies = [world.spawn(kind, position=(3 * i, 0, 0)) for i in range(3)]
    before = state_of(world)
    with pytest.raises(StateError, match=r"3 of 3 .*(Reserve|reserve).*despawn"):
        world.spawn(kind)
    with pytest.raises(StateError, match=r"pool.*reserve"):
        world.spawn(cube())
    with pytest.raises(StateError, match=r"built.*add_body.*reserve"):
        world.reserve(kind, 1)
    with pytest.raises(StateError, match="already built"):
        world.add_body(MESH, JELLY)
    assert state_of(world) == before
    world.spawn(other)  # which has a pool of its own
    world.despawn(bodies[1])
    assert world.spawn(kind).index == 1


def test_only_bodies_that_live_here_can_be_removed(empty):
    world, (kind, _) = empty
    elsewhere = bare_world(floor=None)
    stranger = elsewhere.add_body(MESH, JELLY)
    body = world.spawn(kind)
    gone = world.spawn(kind)
    world.despawn(gone)
    before = state_of(world)
    for value in (stranger, None, 0, kind):
        with pytest.raises(OptionError, match=r"body.*this world"):
            world.despawn(value)
    with pytest.raises(StateError, match="body 1 was removed"):
        world.despawn(gone)
    with pytest.raises(StateError, match="body 1 was removed"):
        world.read_positions(gone, 1.0)
    assert state_of(world) == before
    assert (body.is_alive, stranger.is_alive) == (True, True)


@pytest.mark.parametrize("count", [0, -1, 1.5, True, None, "3", 10**9])
def test_a_count_that_is_none_is_refused_before_anything_is_reserved(count):
    world, kind = bare_world(floor=None), cube()
    with pytest.raises(OptionError, match=r"count.*whole number from 1"):
        world.reserve(kind, count)
    with pytest.raises(StateError, match=r"pool.*reserve"):
        world.spawn(kind)


def test_more_than_fits_into_a_world_is_refused():
    with pytest.raises(OptionError, match=r"27,000,000 vertices.*10,000,000"):
        bare_world(floor=None).reserve(cube(), 1_000_000)


def test_nothing_is_put_below_the_floor():
    world, kind = bare_world(floor=1.0), cube()
    world.reserve(kind, 1)
    with pytest.raises(OptionError, match=r"1\.5 m .*position=\(2, 0, 1\.5\)"):
        world.spawn(kind, position=(2, 0, 0))
    assert world.bodies == ()
    assert world.spawn(kind, position=(2, 0, 1.5)).index == 0
