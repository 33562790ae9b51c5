"""Memory layout of the fields of a world."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import OptionError
from taichi_soft.core.runtime import ti
from taichi_soft.export.kernels.root import read_root
from taichi_soft.solver.state import State

FLOAT, WHOLE = 0, 1
"""Codes for the types of numbers in fields. FLOAT: float32. WHOLE: int32."""


@dataclass(frozen=True)
class FieldPlace:
    """Layout of a field: element i starts at `offset + stride * i` and has `width` numbers."""

    offset: int  # offset from the start of the memory [bytes]
    stride: int
    count: int
    width: int
    kind: int


def places_of(state: State) -> dict[str, FieldPlace]:
    """Return the layouts of all fields with contiguous elements, by name, such as `grabs.body`."""
    places = {name: place_of(field) for name, _, field in state.fields}
    return {name: place for name, place in places.items() if place is not None}


def place_of(field: Any) -> FieldPlace | None:
    """Return the layout of a field, or None if the numbers of an element are not contiguous."""
    components = [each.ptr.snode() for each in field.vars]
    first = components[0]
    dense = first.parent
    if any(
        each.offset_bytes_in_parent_cell != first.offset_bytes_in_parent_cell + 4 * i
        or each.parent.id != dense.id
        for i, each in enumerate(components)
    ):
        return None
    return FieldPlace(
        dense.offset_bytes_in_parent_cell + first.offset_bytes_in_parent_cell,
        dense.cell_size_bytes,
        int(np.prod(field.shape)),
        len(components),
        WHOLE if field.dtype == ti.i32 else FLOAT,
    )


def image_of(state: State) -> NDArray[np.uint8]:
    """Return a copy of the memory of all fields, as bytes."""
    found = np.zeros(1, dtype=np.uint64)
    read_root(state, found)
    place = place_of(state.particle_position)
    if place is None:
        raise OptionError("this version of Taichi has another memory layout: install taichi 1.7.4")
    root = state.particle_position.vars[0].ptr.snode().parent.parent
    begin = int(found[0]) - place.offset
    return np.frombuffer(ctypes.string_at(begin, root.cell_size_bytes), dtype=np.uint8)
