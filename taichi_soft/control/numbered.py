"""Base class of slices with a limited number of handles. A new handle gets the lowest free index."""

from __future__ import annotations

from typing import Generic, TypeVar

from taichi_soft.bodies.soft_body import Context, Slice, SoftBody
from taichi_soft.core.errors import StateError
from taichi_soft.core.handles import Handle

Kind = TypeVar("Kind", bound=Handle)


class Numbered(Slice, Generic[Kind]):
    """Base class of `Grabs`, `Joints` and `Motors`: all handles of one world, by index."""

    most = 0  # largest number of handles
    advice_verb = ""  # verb in the advice of the error that `free_number` raises

    def __init__(self, context: Context) -> None:
        """Start without handles."""
        super().__init__(context)
        self.by_number: dict[int, Kind] = {}

    @property
    def handles(self) -> list[Kind]:
        """All handles, in the order of their indices."""
        return [each for _, each in sorted(self.by_number.items())]

    def holding(self, body: SoftBody) -> list[Kind]:
        """Return the handles of a body, in the order of their indices."""
        return [each for each in self.handles if each.body is body]  # type: ignore[attr-defined]

    def holds(self, body: SoftBody) -> bool:
        """True if a body has handles of this slice."""
        return bool(self.holding(body))

    def free_number(self) -> int:
        """Return the lowest free index. Raises: StateError if all indices are in use."""
        free = next((number for number in range(self.most) if number not in self.by_number), None)
        if free is None:
            raise StateError(
                f"all {self.most} {self.name} of this world are in use: {self.advice_verb} one first"
            )
        return free
