"""Declarations of Taichi fields.

A group of fields is a class that lists each field once, with `declare`. The list says what is allocated, what
a world starts with, what a snapshot stores and which values it refuses, which layout a world file has, and
how the C library reaches the fields (`engine_adapter/native/write_fields.py`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.field_loader import Loader
from taichi_soft.core.runtime import holds_fields, ti

REAL = "real"
"""Type of a field's numbers: float32; float64 in fields that evaluate forces with doubles."""

LOADED = "loaded"
"""`start` of a field whose first contents depend on the bodies: the `load` of its group fills it."""

ANY = float("inf")
FINITE = float(np.finfo(np.float32).max)
"""`most` of a field whose numbers may be anything, or are only required to be finite."""

WORLD, PARTICLE, EDGE, BLOCK, BODY = "world", "particle", "edge", "block", "body"
TRIANGLE, OUTER, RING = "triangle", "outer", "ring"
COLLIDER, SAMPLE, CONTACT, GRID_CELL = "collider", "sample", "contact", "grid cell"
"""What a field can have rows for. A contact is a pair of a body and a collider; `outer` are the particles of
surfaces, and `WORLD` stands for a single row."""

SHAPE = "shape"
"""Group of a snapshot's rows: entries of the rest shapes of tetrahedra that may flow."""


@dataclass(frozen=True)
class Below:
    """Whole numbers from 0 to the number of things there are, plus `beside`, not included."""

    things: str = ""  # PARTICLE, BODY, COLLIDER or FRAME; nothing for a fixed number
    beside: int = 0


FRAME = "frame"


@dataclass(frozen=True, eq=False)
class Declaration:
    """All that is known of a field: see `declare`."""

    rows: str | int
    number: Any
    size: int | tuple[int, int]
    unit: str
    each: int
    beyond: int
    start: float | str | None
    keep: str
    native_keep: str
    below: Below | dict[str, Below] | None
    most: float
    native: bool
    inherited: bool
    when: str
    layout: Any

    def __get__(self, group: object, kind: type) -> Any:
        """Fields of a group that has the field hide this; other groups have only the declaration."""
        if group is None:
            return self
        name = next(name for name, each in kind.declarations().items() if each is self)  # type: ignore[attr-defined]
        raise AttributeError(f"{kind.__name__} of this capacity has no field {name!r}")

    @property
    def is_bounded(self) -> bool:
        """Whether `require` checks it."""
        return self.below is not None or self.most < ANY

    @property
    def is_struct(self) -> bool:
        """Whether a row has named members."""
        return isinstance(self.number, ti.lang.struct.StructType)

    def count(self, counts: Mapping[str, int]) -> int:
        """Number of rows."""
        rows = self.rows if isinstance(self.rows, int) else counts[self.rows]
        return rows * self.each + self.beyond

    def make(self, counts: Mapping[str, int], real: Any) -> Any:
        """Allocate the field; contents are zero."""
        shape = () if self.rows == WORLD else self.count(counts)
        if self.is_struct:
            return self.number.field(shape=shape)
        number = real if self.number is REAL else self.number
        if self.size == 1:
            return ti.field(number, shape)
        options = {} if self.layout is None else {"layout": self.layout}
        if isinstance(self.size, int):
            return ti.Vector.field(self.size, number, shape, **options)
        return ti.Matrix.field(*self.size, number, shape, **options)

    def require(self, rows: NDArray[Any], things: Mapping[str, int]) -> None:
        """Check rows of a snapshot. Raises: ValueError with the value and the bounds.

        Args: things: how many there are of what `Below` names.
        """
        if rows.dtype.kind == "f":
            size = float(np.abs(rows).max(initial=0.0))
            if self.most < ANY and not size <= self.most:
                raise ValueError(f"has {size:g}, beyond {self.most:g}")
        elif isinstance(self.below, Below):
            end = things[self.below.things] + self.below.beside
            if rows.size and not (rows.min() >= 0 and rows.max() < end):
                raise ValueError(f"has {rows.min()} to {rows.max()}, and not only 0 to {end - 1}")


def declare(
    rows: str | int,
    number: Any,
    size: int | tuple[int, int] = 1,
    *,
    unit: str = "",
    each: int = 1,
    beyond: int = 0,
    start: float | str | None = None,
    keep: str = "",
    native_keep: str = "",
    below: Below | dict[str, Below] | None = None,
    most: float = ANY,
    native: bool = False,
    inherited: bool = False,
    when: str = "",
    layout: Any = None,
) -> Any:
    """Declare a field in the body of a `FieldGroup`.

    Args:
        rows: what it has a row for (WORLD, PARTICLE ...), or a fixed number of rows.
        number: type of its numbers: `ti.i32`, `ti.f32`, REAL, or a `ti.dataclass` for rows with members.
        size: numbers per row; (rows, columns) for a matrix.
        unit: SI unit of its numbers.
        each, beyond: rows for each thing, and further rows that code reads beyond the last.
        start: number in all rows of a new world; LOADED if they depend on the bodies; None if a step writes
            them before it reads them.
        keep: group of a snapshot's rows with it, if the next step depends on it.
        native_keep: the same in snapshots of the C library only: Python stores it with the handles.
        below: bounds of the whole numbers that a snapshot may have there; of each member, in rows with some.
        most: bound of the size of the floats that a snapshot may have there.
        native: True if the C library reads or writes it between steps.
        inherited: True if a piece of a cut body gets the numbers of the body.
        when: attribute of a capacity that says whether it has the field; "" if all have it.
        layout: a `ti.Layout` other than the default.
    """
    return Declaration(
        rows,
        number,
        size,
        unit,
        each,
        beyond,
        start,
        keep,
        native_keep,
        below,
        most,
        native,
        inherited,
        when,
        layout,
    )


class FieldGroup:
    """Fields with one owner. Subclasses list them; kernels take a group, or what holds it, as a template."""

    owner: ClassVar[str] = ""
    """Folder of the kernels that write it; "" if all may."""
    when: ClassVar[str] = ""
    """Attribute of a capacity that says whether it has the group; "" if all have it."""

    def __init_subclass__(cls) -> None:
        holds_fields(cls)

    def __init__(self, capacity: Any, real: Any) -> None:
        """Allocate. Args: capacity: has `counts` of rows; real: type of REAL."""
        for name, each in self.declarations().items():
            if not each.when or getattr(capacity, each.when):
                setattr(self, name, each.make(capacity.counts, real))

    @classmethod
    def declarations(cls) -> dict[str, Declaration]:
        """Declarations of all its fields by name, those of base classes first."""
        return {
            name: value
            for base in reversed(cls.__mro__)
            for name, value in vars(base).items()
            if isinstance(value, Declaration)
        }

    def declared(self) -> list[tuple[str, Declaration, Any]]:
        """Name, declaration and field of all fields that it has; for rows with members once per member."""
        found = []
        for name, each in self.declarations().items():
            if name not in vars(self):
                continue
            field = vars(self)[name]
            if each.is_struct:
                for key in field.keys:
                    assert isinstance(each.below, dict)
                    member = replace(each, below=each.below.get(key))
                    found.append((f"{name}.{key}", member, field.get_member_field(key)))
            else:
                found.append((name, each, field))
        return found

    def fill_starts(self, loader: Loader) -> None:
        """Fill the fields that every world starts with the same numbers in."""
        for _, each, field in self.declared():
            if isinstance(each.start, (int, float)):
                loader.fill_all(field, each.start)
