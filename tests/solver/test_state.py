"""Fields as kernels take them."""

from taichi_soft.solver.state import State


def test_reading_a_field_is_no_call_in_python() -> None:
    # Taichi reads some ten attributes of the state at each launch: as calls they took a quarter of the Python
    # of a step.
    for fields in State, *State.GROUPS.values():
        assert fields.__getattribute__ is object.__getattribute__, fields
