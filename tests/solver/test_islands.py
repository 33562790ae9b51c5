"""Islands: bodies that are joined or may touch, directly or through others, against sets in Python."""

from itertools import pairwise

import numpy as np
import pytest

from taichi_soft import Material, SoftBodyAsset, box
from taichi_soft.core.runtime import ti
from taichi_soft.solver.kernels.islands import find_islands
from taichi_soft.world.bare import bare_world

COUNT, EMPTY = 24, 3
DT = 1 / 60
CUBE = box((0.2, 0.2, 0.2), cells=(1, 1, 1))
JELLY = Material(1e5, 0.3, 1000.0)


@ti.kernel
def find(state: ti.template(), body_count: ti.i32, dt: ti.f32):
    ti.loop_config(serialize=True)
    for _ in range(1):
        find_islands(state, body_count, dt)


def crowd(**options):
    """A world of cubes far from each other, some slots empty between them."""
    cube = SoftBodyAsset(CUBE, JELLY)
    world = bare_world(floor=None, gravity=(0, 0, 0), **options)
    world.reserve(cube, COUNT + EMPTY)
    world.build()
    for place in range(COUNT + EMPTY):
        world.spawn(cube, position=(2.0 * place, 0, 0))
    for body in world.bodies[4 : 4 + 5 * EMPTY : 5]:
        world.despawn(body)
    return world


@pytest.fixture(scope="module")
def apart():
    """Return a world in which only joints connect bodies to islands."""
    return crowd(collider_room=1)


@pytest.fixture(scope="module")
def touching():
    """Return a world in which islands are computed in every step."""
    return crowd(soft_contact=True)


def connected(slots, pairs):
    """Sets of slots that pairs connect, each ascending, in the order of their first ones."""
    sets = {slot: {slot} for slot in slots}
    for a, b in pairs:
        both = sets[a] | sets[b]
        sets.update(dict.fromkeys(both, both))
    return [list(each) for each in sorted({tuple(sorted(each)) for each in sets.values()})]


def listed(world):
    """The islands as the step finds them. Checks that each body knows its own."""
    fields = world._built.state.islands
    count = fields.count[None]
    first, rows = fields.first.to_numpy()[: count + 1], fields.body.to_numpy()
    assert first[0] == 0
    islands = [rows[start:end].tolist() for start, end in pairwise(first)]
    number = fields.of_body.to_numpy()
    for island, bodies in enumerate(islands):
        assert (number[bodies] == island).all()
    return islands


def join_some(world, rng):
    """New joints between random bodies. Returns: the slots of each pair."""
    for joint in list(world.joints):
        joint.release()
    pairs = []
    for _ in range(rng.integers(1, COUNT // 2)):
        a, b = rng.choice(np.array(world.bodies), 2, replace=False)
        a.attach_to(b, [0], onto=[0])
        pairs.append((a.index, b.index))
    return pairs


@pytest.mark.parametrize("seed", range(1, 5))
def test_islands_of_joined_bodies_are_their_connected_sets(apart, seed):
    """Each in ascending order, and in that of their first bodies; empty slots are islands of their own."""
    pairs = join_some(apart, np.random.default_rng(seed))
    assert listed(apart) == connected(range(COUNT + EMPTY), pairs)


@pytest.mark.parametrize("seed", range(1, 5))
def test_islands_of_bodies_that_touch_are_their_connected_sets(touching, seed):
    """Joined bodies are included. Empty slots are in no island."""
    world, rng = touching, np.random.default_rng(seed)
    pairs = join_some(world, rng)
    for body in world.bodies:
        shift = rng.uniform(-1.0, 1.0, 3) * (2, 1, 0.2)
        body.set_motion(CUBE.vertices + shift, np.zeros_like(CUBE.vertices))
    find(world._built.state, COUNT + EMPTY, DT)
    state, slots = world._built.state, [body.index for body in world.bodies]
    lower, upper = state.body_bounds_lower.to_numpy(), state.body_bounds_upper.to_numpy()
    near = [
        (a, b)
        for a in slots
        for b in slots
        if a < b and (lower[a] <= upper[b]).all() and (lower[b] <= upper[a]).all()
    ]
    assert near
    wanted = connected(slots, [*pairs, *near])
    assert len(wanted) > 1
    assert listed(world) == wanted
