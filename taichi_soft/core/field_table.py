"""Declarations of Taichi fields.

A group of fields is a class that declares each of its fields once, with `declare`. The declarations determine
the allocation, the initial values, the contents of snapshots and their bounds, the layout of exported worlds,
and the C++ headers (`engine_adapter/native/write_fields.py`).
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
"""Value of `number` for a field of real numbers. They are float32 in a world, and float64 if forces are
evaluated in double precision."""

LOADED = "loaded"
"""Value of `start` for a field whose initial numbers depend on the bodies. The method `load` of the group
fills the field."""

ANY = float("inf")
FINITE = float(np.finfo(np.float32).max)
"""Values of `most`. ANY allows every float, including infinity and NaN. FINITE allows every finite float."""

WORLD, PARTICLE, EDGE, BLOCK, BODY = "world", "particle", "edge", "block", "body"
TRIANGLE, OUTER, RING, SHELL = "triangle", "outer", "ring", "shell"
COLLIDER, SAMPLE, CONTACT, GRID_CELL = "collider", "sample", "contact", "grid cell"
CONTACT_EDGE, FEATURE = "contact edge", "feature"
"""Values of `rows`. They name the thing that a row of a field belongs to. A WORLD field has a single row. A
row of an OUTER field belongs to a particle of a surface. A row of a SHELL field belongs to a block of shell
elements. A row of a FEATURE field belongs to a vertex or an
edge that can touch other bodies. A row of a CONTACT field belongs to a pair of a body and a collider."""

SHAPE = "shape"
"""Value of `keep` for the rest shapes of tetrahedra. Only plastic bodies change their rest shapes, so
snapshots of worlds without plastic bodies omit these fields."""


@dataclass(frozen=True)
class Below:
    """Bounds of integers: at least 0, and less than the number of `things` plus `beside`."""

    things: str = ""  # PARTICLE, BODY, COLLIDER or FRAME; "" counts as 0 things
    beside: int = 0


FRAME = "frame"


@dataclass(frozen=True, eq=False)
class Declaration:
    """Properties of a field. `declare` describes them."""

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
        """Return this declaration if it is read from a class. For an object, raise an AttributeError.

        For an object, Python calls this method only if the group has not allocated the field.
        """
        if group is None:
            return self
        name = next(name for name, each in kind.declarations().items() if each is self)  # type: ignore[attr-defined]
        raise AttributeError(f"{kind.__name__} of this capacity has no field {name!r}")

    @property
    def is_bounded(self) -> bool:
        """True if `require` checks the values of the field."""
        return self.below is not None or self.most < ANY

    @property
    def is_struct(self) -> bool:
        """True if the rows of the field have named members."""
        return isinstance(self.number, ti.lang.struct.StructType)

    def count(self, counts: Mapping[str, int]) -> int:
        """Return the number of rows of the field. `counts` contains the number of each kind of thing."""
        rows = self.rows if isinstance(self.rows, int) else counts[self.rows]
        return rows * self.each + self.beyond

    def make(self, counts: Mapping[str, int], real: Any) -> Any:
        """Allocate the field, filled with zeros, and return it."""
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
        """Check the rows of the field in a snapshot.

        Args:
            rows: rows of the field.
            things: number of each kind of thing, by the names in `Below`.
        Raises: ValueError with the invalid value and the bounds.
        """
        if rows.dtype.kind == "f":
            size = float(np.abs(rows).max(initial=0.0))
            if self.most < ANY and not size <= self.most:
                raise ValueError(f"has a number of size {size:g}; allowed are numbers up to {self.most:g}")
        elif isinstance(self.below, Below):
            end = things[self.below.things] + self.below.beside
            if rows.size and not (rows.min() >= 0 and rows.max() < end):
                raise ValueError(f"has numbers from {rows.min()} to {rows.max()}; allowed are 0 to {end - 1}")


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
        rows: the thing that a row belongs to (WORLD, PARTICLE ...), or a fixed number of rows.
        number: type of the field's numbers: `ti.i32`, `ti.f32`, REAL, or a `ti.dataclass` for rows with
            members.
        size: number of numbers per row; (rows, columns) for a matrix.
        unit: SI unit of the numbers.
        each: number of rows per thing.
        beyond: number of spare rows at the end of the field. Kernels can read these rows.
        start: initial number in all rows; LOADED if the numbers depend on the bodies; None if a step writes
            the rows before it reads them.
        keep: group of fields in a snapshot to which the field belongs; "" if snapshots omit the field,
            because the next step does not depend on it.
        native_keep: value of `keep` in snapshots of the C library, for data that Python stores with the
            handles instead.
        below: bounds of integers in a snapshot; for rows with members, a dictionary of bounds by member.
        most: largest absolute value of floats in a snapshot.
        native: True if the C library reads or writes the field between steps.
        inherited: True if each piece of a cut body gets the values of the body.
        when: attribute of the capacity that is true if the group has the field; "" if every group has the
            field.
        layout: a `ti.Layout`; None for Taichi's default.
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
    """Base class of groups of fields with one owner. A subclass declares the fields of its group.

    Kernels receive a group or a `State` as a template argument.
    """

    owner: ClassVar[str] = ""
    """Folder of the kernels that can write the group; "" if all kernels can write it."""
    when: ClassVar[str] = ""
    """Attribute of the capacity that is true if the world has the group; "" if every world has it."""

    def __init_subclass__(cls) -> None:
        holds_fields(cls)

    def __init__(self, capacity: Any, real: Any) -> None:
        """Allocate the fields.

        Args:
            capacity: object with `counts`, the number of each kind of thing.
            real: type of the numbers of REAL fields.
        """
        for name, each in self.declarations().items():
            if not each.when or getattr(capacity, each.when):
                setattr(self, name, each.make(capacity.counts, real))

    @classmethod
    def declarations(cls) -> dict[str, Declaration]:
        """Return the declarations of all fields by name. The fields of base classes come first."""
        return {
            name: value
            for base in reversed(cls.__mro__)
            for name, value in vars(base).items()
            if isinstance(value, Declaration)
        }

    def declared(self) -> list[tuple[str, Declaration, Any]]:
        """Return the name, the declaration and the Taichi field of each allocated field.

        A field whose rows have members has one entry per member.
        """
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
        """Make `loader` fill the fields whose initial number is the same in all worlds."""
        for _, each, field in self.declared():
            if isinstance(each.start, (int, float)):
                loader.fill_all(field, each.start)
