"""States before the changes that visitors made, for undo."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from taichi_soft import Grab
from taichi_soft.live.controls import Given

MOST_CHANGES = 20
"""Changes that can be undone."""

DRAG = 2.0
"""Values of a slider that follow each other within this time count as one change [s]."""


@dataclass(frozen=True)
class Before:
    """A world before a change.

    Args:
        what: the change, as the page names it.
        sliders: values that were given.
        snapshot: the whole state; None if only the sliders can be set back.
        held: grabs in that state.
    """

    what: str
    sliders: Given
    snapshot: bytes | None
    held: tuple[Grab, ...] = ()


class History:
    """The last changes."""

    def __init__(self) -> None:
        self._changes: deque[Before] = deque(maxlen=MOST_CHANGES)
        self._drag_at = -math.inf  # when the last change, a slider's, got its last value [s]

    @property
    def last(self) -> str | None:
        """Name of the change that an undo takes back."""
        return self._changes[-1].what if self._changes else None

    def add(self, before: Before, *, drag_at: float | None = None) -> None:
        """Record the state before a change; `drag_at`: the time of a slider's change [s]."""
        self._changes.append(before)
        self._drag_at = -math.inf if drag_at is None else drag_at

    def goes_on(self, what: str, now: float) -> bool:
        """Return True if a slider's value belongs to the last change: the same slider is still dragged."""
        if self.last != what or now - self._drag_at > DRAG:
            return False
        self._drag_at = now
        return True

    def pop(self) -> Before | None:
        """Return the last change and remove it; None if there is none."""
        self._drag_at = -math.inf
        return self._changes.pop() if self._changes else None

    def clear(self) -> None:
        """Forget all changes."""
        self._changes.clear()
        self._drag_at = -math.inf
