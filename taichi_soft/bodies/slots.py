"""Slots of a world's fields: the asset of each slot, and the body that occupies it."""

from __future__ import annotations

import heapq
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.core.errors import StateError


class Occupant(Protocol):
    """A body that occupies a slot."""

    @property
    def index(self) -> int:
        """Index of the body's slot."""

    @property
    def asset(self) -> SoftBodyAsset:
        """Asset whose slots the body can occupy."""


Kind = TypeVar("Kind", bound=Occupant)


class Pools(Generic[Kind]):
    """Slots of one world. A body gets the lowest free slot of its asset, so that slots are reproducible."""

    def __init__(self) -> None:
        self.assets: list[SoftBodyAsset] = []  # asset of each slot
        self.slots: list[Kind | None] = []  # body in each slot
        self.starts: dict[int, NDArray[np.float32]] = {}  # initial rows of bodies from `add_body`, by slot
        self.added: dict[tuple[Any, ...], SoftBodyAsset] = {}  # assets that `add_body` made, by content
        self._free: dict[SoftBodyAsset, list[int]] = {}  # free slots of each asset, as heaps
        self._occupants: tuple[Kind, ...] | None = ()

    @property
    def kinds(self) -> tuple[SoftBodyAsset, ...]:
        """All assets, each once, in the order of their first slots."""
        return tuple(self._free)

    @property
    def can_touch(self) -> bool:
        """True if bodies, or parts of one body, can touch each other.

        This is the case if the world has two slots, or an asset with self-contact.
        """
        return len(self.slots) > 1 or any(
            level.contact.itself for asset in self.kinds for level in asset.levels
        )

    @property
    def occupants(self) -> tuple[Kind, ...]:
        """All bodies, in the order of their slots."""
        if self._occupants is None:
            self._occupants = tuple(body for body in self.slots if body is not None)
        return self._occupants

    def add_slot(self, asset: SoftBodyAsset) -> None:
        """Add a slot for `asset` with the next number."""
        heapq.heappush(self._free.setdefault(asset, []), len(self.slots))
        self.assets.append(asset)
        self.slots.append(None)

    def free_slots(self, asset: SoftBodyAsset) -> list[int]:
        """Return the free slots of an asset, in the order in which bodies will get them."""
        return sorted(self._free[asset])

    def next_slot(self, asset: SoftBodyAsset) -> int:
        """Return the slot that the next body of an asset will get. Raises: StateError if none is free."""
        free = self._free.get(asset)
        if free is None:
            raise StateError(f"{asset!r} has no pool in this world: call reserve(asset, count) before build")
        if not free:
            count = self.assets.count(asset)
            raise StateError(
                f"the pool of {asset!r} is full: {count} of {count} slots are occupied. Reserve more before "
                "build, or despawn one"
            )
        return free[0]

    def enter(self, body: Kind) -> None:
        """Put a body into the next slot of its asset. `body.index` must be the number of this slot."""
        heapq.heappop(self._free[body.asset])
        self.slots[body.index] = body
        self._occupants = None

    def enter_at(self, body: Kind) -> None:
        """Put a body into the free slot `body.index`, even if another slot is next."""
        free = self._free[body.asset]
        free.remove(body.index)
        heapq.heapify(free)
        self.slots[body.index] = body
        self._occupants = None

    def leave(self, body: Kind) -> None:
        """Free the slot of a body."""
        heapq.heappush(self._free[body.asset], body.index)
        self.slots[body.index] = None
        self.starts.pop(body.index, None)
        self._occupants = None
