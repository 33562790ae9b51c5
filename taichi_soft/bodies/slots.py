"""Who lives in a world: the slots that assets have in its fields, and the body in each."""

from __future__ import annotations

import heapq
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.core.errors import StateError


class Occupant(Protocol):
    """What lives in a slot."""

    @property
    def index(self) -> int:
        """Of its slot."""

    @property
    def asset(self) -> SoftBodyAsset:
        """Whose slots it may have."""


Kind = TypeVar("Kind", bound=Occupant)


class Pools(Generic[Kind]):
    """Slots of one world. A body takes the lowest free one of its asset: that follows from who lives."""

    def __init__(self) -> None:
        self.assets: list[SoftBodyAsset] = []  # of each slot
        self.slots: list[Kind | None] = []  # who lives there
        self.starts: dict[int, NDArray[np.float32]] = {}  # of bodies that came before build, by slot
        self.added: dict[tuple[Any, ...], SoftBodyAsset] = {}  # by add_body, by their content
        self._free: dict[SoftBodyAsset, list[int]] = {}  # heaps
        self._living: tuple[Kind, ...] | None = ()

    @property
    def kinds(self) -> tuple[SoftBodyAsset, ...]:
        """Every asset once, in the order of their first slots."""
        return tuple(self._free)

    @property
    def living(self) -> tuple[Kind, ...]:
        """All bodies there are, by slot."""
        if self._living is None:
            self._living = tuple(body for body in self.slots if body is not None)
        return self._living

    def add_slot(self, asset: SoftBodyAsset) -> None:
        """One slot more, with the next number."""
        heapq.heappush(self._free.setdefault(asset, []), len(self.slots))
        self.assets.append(asset)
        self.slots.append(None)

    def free_slots(self, asset: SoftBodyAsset) -> list[int]:
        """Where the next bodies of an asset go, in that order."""
        return sorted(self._free[asset])

    def next_slot(self, asset: SoftBodyAsset) -> int:
        """Where the next body of an asset goes. Raises: StateError where it has no slot, or no free one."""
        free = self._free.get(asset)
        if free is None:
            raise StateError(f"{asset!r} has no pool in this world: call reserve(asset, count) before build")
        if not free:
            count = self.assets.count(asset)
            raise StateError(
                f"the pool of {asset!r} is full: {count} of {count} bodies live. Reserve more before "
                "build, or despawn one"
            )
        return free[0]

    def enter(self, body: Kind) -> None:
        """Give a body the next slot of its asset, whose number it has."""
        heapq.heappop(self._free[body.asset])
        self.slots[body.index] = body
        self._living = None

    def enter_at(self, body: Kind) -> None:
        """Give a body the free slot that has its number, whichever is next."""
        free = self._free[body.asset]
        free.remove(body.index)
        heapq.heapify(free)
        self.slots[body.index] = body
        self._living = None

    def leave(self, body: Kind) -> None:
        """Free the slot of a body."""
        heapq.heappush(self._free[body.asset], body.index)
        self.slots[body.index] = None
        self.starts.pop(body.index, None)
        self._living = None
