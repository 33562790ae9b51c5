"""What the events of coming steps depend on, of the steps before: kept in a snapshot, beside the state.

It is no part of the state: two worlds in step may listen to different events.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.bodies.status import ABSENT
from taichi_soft.contact.collider import Collider
from taichi_soft.core.serialisation import as_plain, from_plain
from taichi_soft.events.kinds import STRESS_KINDS, Event

CONTACT_WIDTH = 11
"""A row of a contact: key (3), serial numbers of the two, began, touched, pause [s], impulse (3) [N s]."""

_KINDS = {kind.__name__: kind for kind in STRESS_KINDS}


@dataclass(frozen=True)
class Known:
    """Handles that somebody holds, by their serial numbers."""

    body: Callable[[int], SoftBody | None]
    collider: Callable[[int], Collider | None]


@dataclass
class WatchNote:
    """A watch of `Body.watch_stress` or `watch_tearing`."""

    kind: type[Event]
    serial: int  # of the body
    threshold: float  # [Pa]
    is_over: bytes  # a bit for each tetrahedron, in kernel order


@dataclass
class Memory:
    """None for what nobody asked for."""

    status: NDArray[np.int32] | None  # of the bodies in each slot, after the last step
    contacts: NDArray[np.float64] | None  # that go on, (k, CONTACT_WIDTH)
    watches: list[WatchNote]

    @property
    def plain(self) -> dict[str, Any]:
        """As data that JSON takes."""
        return {
            "status": None if self.status is None else self.status.tolist(),
            "contacts": as_plain(self.contacts),
            "watches": [[w.kind.__name__, w.serial, w.threshold, w.is_over.hex()] for w in self.watches],
        }

    @classmethod
    def of(cls, plain: Any, slots: int) -> Memory:
        """The same again, for a world of so many slots. Raises: ValueError, or what Python raises."""
        status, contacts = plain["status"], from_plain(plain["contacts"])
        if status is not None:
            status = np.array(status, dtype=np.int32)
            if status.shape != (slots,) or not ((status >= 0) & (status <= ABSENT)).all():
                raise ValueError("it does not know who slept")
        if contacts is not None:
            contacts = np.array(contacts, dtype=np.float64)
            if contacts.shape != (len(contacts), CONTACT_WIDTH) or not np.isfinite(contacts).all():
                raise ValueError("a contact is none")
        watches = [
            WatchNote(_KINDS[kind], int(serial), float(threshold), bytes.fromhex(is_over))
            for kind, serial, threshold, is_over in plain["watches"]
        ]
        return cls(status, contacts, watches)
