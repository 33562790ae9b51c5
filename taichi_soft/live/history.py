"""Store the states before visitors' changes, for undo."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from taichi_soft import Grab
from taichi_soft.live.controls import Given

MOST_CHANGES = 20
"""Largest number of changes that can be undone."""

DRAG = 2.0
"""Largest time between two values of a slider for which both belong to the same change [s]."""


@dataclass(frozen=True)
class Before:
    """State of a world before a change.

    Args:
        what: name of the change, as the page shows it.
        sliders: chosen slider values.
        snapshot: complete state; None if only the sliders can be restored.
        held: grabs that exist in the stored state.
    """

    what: str
    sliders: Given
    snapshot: bytes | None
    held: tuple[Grab, ...] = ()


class History:
    """States before the last changes, the newest last."""

    def __init__(self) -> None:
        self._changes: deque[Before] = deque(maxlen=MOST_CHANGES)
        self._drag_at = -math.inf  # time of the last change if it was a slider value [s], else -inf

    @property
    def last(self) -> str | None:
        """Name of the change that the next undo reverts."""
        return self._changes[-1].what if self._changes else None

    def add(self, before: Before, *, drag_at: float | None = None) -> None:
        """Store the state before a change. For a slider, `drag_at` is the time of the change [s]."""
        self._changes.append(before)
        self._drag_at = -math.inf if drag_at is None else drag_at

    def goes_on(self, what: str, now: float) -> bool:
        """True if `what` continues the last change, because the same slider is still being dragged."""
        if self.last != what or now - self._drag_at > DRAG:
            return False
        self._drag_at = now
        return True

    def pop(self) -> Before | None:
        """Remove and return the state before the last change; None if the history is empty."""
        self._drag_at = -math.inf
        return self._changes.pop() if self._changes else None

    def clear(self) -> None:
        """Remove all changes."""
        self._changes.clear()
        self._drag_at = -math.inf
