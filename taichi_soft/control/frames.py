"""Frames of the engine that bodies hang from, and the call that aims all pinned particles before a step."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.checks import as_rotation, as_vector
from taichi_soft.kernels.pins import aim_pinned

if TYPE_CHECKING:
    from taichi_soft.state import State


class Frames:
    """Poses of all frames of one world: rotation row by row, and position [m], (f, 12)."""

    def __init__(self) -> None:
        """None yet; one row, as a kernel takes no empty array."""
        self.count = 0
        self.present = np.zeros((1, 12), dtype=np.float32)
        self.coming = self.present.copy()  # at the end of the coming step
        self.has_work = False  # some pinned particle has somewhere to go, or has just arrived

    def add(self, pose: NDArray[np.float32]) -> int:
        """The number of a new frame."""
        self.present = np.concatenate([self.present[: self.count], pose[None]])
        self.coming = np.concatenate([self.coming[: self.count], pose[None]])
        self.count += 1
        return self.count - 1

    def aim(self, state: State, body_count: int, dt: float) -> None:
        """Give pinned particles the velocities of the coming step."""
        if self.has_work:
            self.has_work = aim_pinned(state, body_count, dt, self.coming) > 0
        if self.count:
            self.present[:] = self.coming


class Frame:
    """A place that moves as the engine says: a bone, a vehicle, a hand. Made by `World.add_frame`."""

    def __init__(self, frames: Frames, position: ArrayLike, rotation: Any) -> None:
        """Made by `World.add_frame`."""
        self._frames = frames
        self._number = frames.add(_pose(position, rotation))

    def __repr__(self) -> str:
        return f"Frame({self._number}, position={self.position.round(3).tolist()})"

    @property
    def position(self) -> NDArray[np.float32]:
        """Where its origin is after the last step, (3,) [m]."""
        return np.array(self._frames.present[self._number, 9:])

    @property
    def rotation(self) -> NDArray[np.float32]:
        """Its axes after the last step, as columns, (3, 3)."""
        return np.array(self._frames.present[self._number, :9].reshape(3, 3))

    def move_to(self, position: ArrayLike, rotation: ArrayLike | None = None) -> None:
        """Say where it is at the end of the coming step; it stays there until it is moved again.

        Args:
            position: of its origin, (3,) [m].
            rotation: matrix (3, 3) or quaternion (x, y, z, w); None keeps its axes as they are.
        Raises: OptionError for bad numbers.
        """
        axes = self._frames.coming[self._number, :9].copy()
        pose = _pose(position, rotation)
        if rotation is None:
            pose[:9] = axes
        self._frames.coming[self._number] = pose


def _pose(position: ArrayLike, rotation: Any) -> NDArray[np.float32]:
    place = as_vector(position, "position", "m")
    return np.concatenate([as_rotation(rotation).ravel(), place]).astype(np.float32)
