"""Slices whose handles have numbers: so many at a time, the lowest free one first."""

from __future__ import annotations

from typing import Generic, TypeVar

from taichi_soft.bodies.soft_body import Context, Slice, SoftBody
from taichi_soft.core.errors import StateError
from taichi_soft.core.handles import Handle

Kind = TypeVar("Kind", bound=Handle)


class Numbered(Slice, Generic[Kind]):
    """Grabs, joints, motors: all of one world, by number."""

    most = 0  # at a time
    way_out = ""  # for who wants more

    def __init__(self, context: Context) -> None:
        """None yet."""
        super().__init__(context)
        self.by_number: dict[int, Kind] = {}

    @property
    def handles(self) -> list[Kind]:
        """Of all there are, by number."""
        return [each for _, each in sorted(self.by_number.items())]

    def holding(self, body: SoftBody) -> list[Kind]:
        """Those that hold a body, by number."""
        return [each for each in self.handles if each.body is body]  # type: ignore[attr-defined]

    def holds(self, body: SoftBody) -> bool:
        """Whether there are such."""
        return bool(self.holding(body))

    def free_number(self) -> int:
        """The lowest. Raises: StateError where there is none."""
        free = next((number for number in range(self.most) if number not in self.by_number), None)
        if free is None:
            raise StateError(
                f"all {self.most} {self.name} of this world are in use: {self.way_out} one first"
            )
        return free
