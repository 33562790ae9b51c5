"""Which contacts go on, from the impulses of each step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.contact.collider import Collider
from taichi_soft.contact.kernels.touches import OF_BODY
from taichi_soft.core.handles import serial_of
from taichi_soft.events.event_state import CONTACT_WIDTH, Known
from taichi_soft.events.kinds import ContactBegan, ContactEnded

CONTACT_PAUSE = 0.05
"""Time without an impulse [s] after which a contact has ended. Single vertices of what rests, rolls or slides
lose and find the ground all the time; a hop as long as this is 3 mm high."""

Key = tuple[int, int, int]
"""A body, what the other is, and that collider or body: rows of `read_touches`."""

Vector = tuple[float, float, float]


@dataclass(eq=False)
class _Contact:
    a: SoftBody
    b: Collider | SoftBody
    began: float  # [s], start of the first step with an impulse
    touched: float  # [s], end of the last, or of rest
    pause: float = 0.0  # [s] in which either of them has moved since
    impulse: Vector = (0.0, 0.0, 0.0)  # [N s]

    def add(self, impulse: Vector, time: float) -> None:
        """An impulse in the step that ends at `time` [s]."""
        (x, y, z), (dx, dy, dz) = self.impulse, impulse
        self.impulse = (x + dx, y + dy, z + dz)
        self.touched, self.pause = time, 0.0

    def wait(self, dt: float, time: float, is_moving: bool) -> None:
        """A step without an impulse: where neither moves, they lie as they lay."""
        if is_moving:
            self.pause += dt
        else:
            self.touched = time

    @property
    def is_over(self) -> bool:
        return self.pause > CONTACT_PAUSE - 1e-9 or not (self.a.is_alive and self.b.is_alive)

    def end(self, step: int, time: float) -> ContactEnded:
        return ContactEnded(step, time, self.a, self.b, np.array(self.impulse), self.touched - self.began)


@dataclass
class Contacts:
    """The contacts that go on now."""

    _going_on: dict[Key, _Contact] = field(default_factory=dict)

    def follow(
        self,
        touches: dict[Key, Vector],
        handles: Callable[[Key], tuple[SoftBody, Collider | SoftBody]],
        moving: set[int],
        step: int,
        time: float,
        dt: float,
    ) -> tuple[list[ContactBegan], list[ContactEnded]]:
        """What began and what ended in a step, each in the order of the keys.

        Args:
            touches: what the first of each pair that touched gave the second [N s].
            handles: of a pair.
            moving: indices of the bodies that move: between others a contact just goes on.
            step, time, dt: of the world; at its end [s]; its length [s].
        """
        ended = []
        for key in sorted(self._going_on):
            contact = self._going_on[key]
            if key not in touches:
                contact.wait(dt, time, key[0] in moving or (key[1] == OF_BODY and key[2] in moving))
            if contact.is_over:
                del self._going_on[key]
                ended.append(contact.end(step, time))
        began = []
        for key in sorted(touches):
            if key not in self._going_on:
                a, b = handles(key)
                self._going_on[key] = _Contact(a, b, time - dt, time)
                began.append(ContactBegan(step, time, a, b, np.array(touches[key])))
            self._going_on[key].add(touches[key], time)
        return began, ended

    @property
    def rows(self) -> NDArray[np.float64]:
        """All of them, as `Memory` keeps them."""
        rows = [
            (*key, serial_of(c.a), serial_of(c.b), c.began, c.touched, c.pause, *c.impulse)
            for key, c in sorted(self._going_on.items())
        ]
        return np.array(rows, dtype=np.float64).reshape(-1, CONTACT_WIDTH)

    def recall(self, rows: NDArray[np.float64], known: Known) -> None:
        """Go on with the contacts of an earlier state; who was gone then, and nobody knows, has none."""
        going_on: dict[Key, _Contact] = {}
        for row in rows.tolist():
            i, kind, j, serial, other = map(int, row[:5])
            a, b = known.body(serial), (known.body if kind == OF_BODY else known.collider)(other)
            if a is not None and b is not None and (a.index, b.index) == (i, j):
                began, touched, pause, x, y, z = row[5:]
                going_on[i, kind, j] = _Contact(a, b, began, touched, pause, (x, y, z))
        self._going_on = going_on
