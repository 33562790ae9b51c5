"""Fields remain after the end of their world, and a later world that fits into them reuses them."""

import gc

import pytest

from taichi_soft import Material, box
from taichi_soft.bodies import fields
from taichi_soft.contact.fields import ContactCapacity
from taichi_soft.solver.state import Capacity
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak

CUBE = box(cells=(1, 1, 1))
JELLY = Material(1e5, 0.2, 1000.0, 20.0)


def fallen(count):
    """Return a world with this number of cubes in stacks of two, after they hit the floor and each other."""
    world = bare_world(soft_contact=True)
    for i in range(count):
        world.add_body(CUBE, JELLY, position=(2.0 * (i // 2), 0.1 * (i % 2), 0.7 + 1.2 * (i % 2)))
    world.build()
    for _ in range(40):
        world.step(1 / 60, 4)
    return world


def room(world):
    return world._built.state.capacity.bodies


def test_a_world_moves_the_same_in_the_fields_of_a_larger_one(monkeypatch):
    gc.collect()  # worlds of earlier tests give back their fields before, not into the empty list
    monkeypatch.setattr(fields, "_free", [])
    large = fallen(20)
    assert room(large) == 32
    del large
    gc.collect()
    guest = fallen(2)
    assert room(guest) == 32
    host = fallen(2)
    assert room(host) == 16
    assert guest.snapshot() == host.snapshot()
    name, data = host.state_hash(), host.snapshot()
    host.step(1 / 60, 4)
    assert host.state_hash() != name
    guest.step(1 / 60, 4)
    assert guest.state_hash() == host.state_hash()
    guest.restore(data)
    assert guest.state_hash() == name


def test_fields_for_what_a_world_does_not_do_are_not_taken(monkeypatch):
    """A world does not reuse fields that are too short in any dimension."""
    least = {"particles": 8, "edges": 8, "blocks": 8, "bodies": 8, "triangles": 8, "outer": 8}
    plain = Capacity(**least, parallel=False)
    for other in (
        Capacity(**least, parallel=True),
        Capacity(**least, parallel=False, rings=512),
        Capacity(**least, parallel=False, implicit=True),
        Capacity(**least, parallel=False, double=True),
        Capacity(**least, parallel=False, contact=ContactCapacity(8)),
    ):
        assert not plain.has_room_for(other)
        assert not other.has_room_for(plain)
    for name in least:
        longer = Capacity(**{**least, name: 16}, parallel=False)
        assert longer.has_room_for(plain)
        assert not plain.has_room_for(longer)
