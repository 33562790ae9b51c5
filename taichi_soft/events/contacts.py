"""Find the contacts that begin and end, from the impulses of each step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.contact.collider import Collider
from taichi_soft.contact.kernels.touches import OF_BODY
from taichi_soft.core.handles import serial_of
from taichi_soft.events.event_state import CONTACT_WIDTH, HandleLookup
from taichi_soft.events.kinds import ContactBegan, ContactEnded

CONTACT_PAUSE = 0.05
"""Time without an impulse after which a contact ends [s]. It is longer than the hops of single vertices of
a body that rests, rolls or slides. A hop of this duration is 3 mm high."""

Key = tuple[int, int, int]
"""Key of a contact: index of a body, kind of the other object, index of the other object. See
`read_touches`."""

Vector = tuple[float, float, float]


@dataclass(eq=False)
class _Contact:
    a: SoftBody
    b: Collider | SoftBody
    began: float  # [s], start of the first step with an impulse
    touched: float  # [s], end of the last step with an impulse or with both objects at rest
    pause: float = 0.0  # [s], time after `touched` during which one or both objects moved
    impulse: Vector = (0.0, 0.0, 0.0)  # [N s], total impulse on the second object

    def add(self, impulse: Vector, time: float) -> None:
        """Add the impulse of the step that ends at `time` [s]."""
        (x, y, z), (dx, dy, dz) = self.impulse, impulse
        self.impulse = (x + dx, y + dy, z + dz)
        self.touched, self.pause = time, 0.0

    def skip(self, dt: float, time: float, is_moving: bool) -> None:
        """Process a step without an impulse.

        The step is added to `pause` if one of the two objects moves. Otherwise, the contact continues.
        """
        if is_moving:
            self.pause += dt
        else:
            self.touched = time

    @property
    def has_ended(self) -> bool:
        return self.pause > CONTACT_PAUSE - 1e-9 or not (self.a.is_alive and self.b.is_alive)

    def end(self, step: int, time: float) -> ContactEnded:
        return ContactEnded(step, time, self.a, self.b, np.array(self.impulse), self.touched - self.began)


@dataclass
class Contacts:
    """Contacts that are active now."""

    _active: dict[Key, _Contact] = field(default_factory=dict)

    def update(
        self,
        touches: dict[Key, Vector],
        handles: Callable[[Key], tuple[SoftBody, Collider | SoftBody]],
        moving: set[int],
        step: int,
        time: float,
        dt: float,
    ) -> tuple[list[ContactBegan], list[ContactEnded]]:
        """Update the contacts after a step.

        Returns: events of the contacts that began, and of the contacts that ended, each sorted by key.
        Args:
            touches: impulse of the first object of each touching pair on the second object [N s].
            handles: returns the two handles of a pair.
            moving: indices of the bodies that move. A contact between resting objects continues.
            step, time, dt: index of the step; its end [s]; its length [s].
        """
        ended = []
        for key in sorted(self._active):
            contact = self._active[key]
            if key not in touches:
                contact.skip(dt, time, key[0] in moving or (key[1] == OF_BODY and key[2] in moving))
            if contact.has_ended:
                del self._active[key]
                ended.append(contact.end(step, time))
        began = []
        for key in sorted(touches):
            if key not in self._active:
                a, b = handles(key)
                self._active[key] = _Contact(a, b, time - dt, time)
                began.append(ContactBegan(step, time, a, b, np.array(touches[key])))
            self._active[key].add(touches[key], time)
        return began, ended

    def end_unless(self, may_touch: Callable[[Key], bool]) -> None:
        """Make the contacts of pairs that may not touch end in the next step, as if they had paused for long.

        Args: may_touch: returns False for a pair that its groups and masks keep apart.
        """
        for key, contact in self._active.items():
            if not may_touch(key):
                contact.pause = CONTACT_PAUSE

    @property
    def rows(self) -> NDArray[np.float64]:
        """All contacts as rows of `EventState.contacts`."""
        rows = [
            (*key, serial_of(c.a), serial_of(c.b), c.began, c.touched, c.pause, *c.impulse)
            for key, c in sorted(self._active.items())
        ]
        return np.array(rows, dtype=np.float64).reshape(-1, CONTACT_WIDTH)

    def restore(self, rows: NDArray[np.float64], lookup: HandleLookup) -> None:
        """Continue with the contacts of an earlier state, except those of objects that no longer exist."""
        active: dict[Key, _Contact] = {}
        for row in rows.tolist():
            i, kind, j, serial, other = map(int, row[:5])
            a, b = lookup.body(serial), (lookup.body if kind == OF_BODY else lookup.collider)(other)
            if a is not None and b is not None and (a.index, b.index) == (i, j):
                began, touched, pause, x, y, z = row[5:]
                active[i, kind, j] = _Contact(a, b, began, touched, pause, (x, y, z))
        self._active = active
