"""State on which the events of later steps depend.

A snapshot stores this state separately from the state of the world, because two worlds in lockstep can record
different events.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.bodies.status import FROZEN_DISABLED
from taichi_soft.contact.collider import Collider
from taichi_soft.core.serialisation import as_plain, from_plain
from taichi_soft.events.kinds import STRESS_KINDS, Event

CONTACT_WIDTH = 11
"""Number of columns of a contact in `EventState.contacts`: key (3), serial numbers of both objects (2),
`began`, `touched` and `pause` [s] (3), impulse [N s] (3)."""

_KINDS = {kind.__name__: kind for kind in STRESS_KINDS}


@dataclass(frozen=True)
class HandleLookup:
    """Lookup of the handles that the caller still holds, by serial number."""

    body: Callable[[int], SoftBody | None]
    collider: Callable[[int], Collider | None]


@dataclass
class WatchEntry:
    """Stored watch of `Body.watch_stress` or `watch_tearing`."""

    kind: type[Event]
    serial: int  # serial number of the body
    threshold: float  # [Pa]
    is_above: bytes  # one bit for each tetrahedron in kernel order; 1: above the threshold


@dataclass
class EventState:
    """State on which later events depend. A field is None if no recorded event depends on it."""

    status: NDArray[np.int32] | None  # status of the body in each slot, after the last step
    contacts: NDArray[np.float64] | None  # active contacts, (k, CONTACT_WIDTH)
    inside: NDArray[np.int64] | None  # bodies in sensors: slot, index of sensor, two serial numbers, (k, 4)
    watches: list[WatchEntry]

    @property
    def plain(self) -> dict[str, Any]:
        """This state as plain data for JSON."""
        return {
            "status": None if self.status is None else self.status.tolist(),
            "contacts": as_plain(self.contacts),
            "inside": None if self.inside is None else self.inside.tolist(),
            "watches": [[w.kind.__name__, w.serial, w.threshold, w.is_above.hex()] for w in self.watches],
        }

    @classmethod
    def of(cls, plain: Any, slots: int) -> EventState:
        """Restore a state from `plain` data, for a world with `slots` slots.

        Raises: ValueError for invalid values; ValueError, KeyError or TypeError for another data structure.
        """
        status, contacts = plain["status"], from_plain(plain["contacts"])
        if status is not None:
            status = np.array(status, dtype=np.int32)
            if status.shape != (slots,) or not ((status >= 0) & (status <= FROZEN_DISABLED)).all():
                raise ValueError("the status of the bodies in its event state is invalid")
        if contacts is not None:
            contacts = np.array(contacts, dtype=np.float64)
            if contacts.shape != (len(contacts), CONTACT_WIDTH) or not np.isfinite(contacts).all():
                raise ValueError("a contact in its event state is invalid")
        inside = plain["inside"]
        if inside is not None:
            inside = np.array(inside, dtype=np.int64).reshape(-1, 4)
        watches = [
            WatchEntry(_KINDS[kind], int(serial), float(threshold), bytes.fromhex(is_above))
            for kind, serial, threshold, is_above in plain["watches"]
        ]
        return cls(status, contacts, inside, watches)
