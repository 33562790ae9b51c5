"""Fields as kernels take them, and their contents in a new world."""

import pytest

from taichi_soft import Material, Plasticity, box
from taichi_soft.solver.state import State
from taichi_soft.world.bare import bare_world
from taichi_soft.world.world import context_of_world

WORLDS = {
    "contact and plastic flow": ({"soft_contact": True}, {"plasticity": Plasticity(yield_stress=1e3)}),
    "implicit Euler and springs": ({"integrator": "implicit_euler"}, {"law": "springs"}),
}


def test_reading_a_field_is_no_call_in_python() -> None:
    # Taichi reads some ten attributes of the state at each launch: as calls they took a quarter of the Python
    # of a step.
    for fields in State, *State.GROUPS.values():
        assert fields.__getattribute__ is object.__getattribute__, fields


@pytest.mark.parametrize("name", WORLDS)
def test_a_new_world_writes_the_fields_that_have_a_start_and_no_others(name):
    # A world can get the fields of an earlier one: what it does not write has the numbers of that world.
    options, of_body = WORLDS[name]
    world = bare_world(**options)
    world.add_body(box((1, 1, 1), (1, 1, 1)), Material(1e5, 0.3, 1000.0), position=(0, 0, 1), **of_body)
    world.build()
    state = context_of_world(world).built.state
    written = [id(field) for field, *_ in state.loader.pieces]
    declared = [id(field) for _, each, field in state.fields if each.start is not None]
    assert len(set(written)) == len(written)
    assert set(written) == set(declared)
