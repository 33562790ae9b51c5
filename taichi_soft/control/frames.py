"""Where pinned particles are to be: the frames of a world, and the call that aims particles before a step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from taichi_soft.kernels.pins import aim_pinned

if TYPE_CHECKING:
    from taichi_soft.state import State


class Frames:
    """Poses of the frames of one world at the end of the coming step."""

    def __init__(self) -> None:
        """None yet."""
        self.poses = np.zeros((1, 12), dtype=np.float32)  # see `aim_pinned`
        self.has_work = False  # some pinned particle has somewhere to go, or has just arrived

    def aim(self, state: State, body_count: int, dt: float) -> None:
        """Give pinned particles the velocities of the coming step."""
        if self.has_work:
            self.has_work = aim_pinned(state, body_count, dt, self.poses) > 0
