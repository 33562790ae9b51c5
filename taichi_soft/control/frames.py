"""Frames of the engine that bodies hang from, and the call that aims all pinned particles before a step."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.checks import as_rotation, as_vector
from taichi_soft.errors import StateError
from taichi_soft.handles import Handle, recorded
from taichi_soft.kernels.pins import aim_pinned

if TYPE_CHECKING:
    from taichi_soft.state import State


class Frames:
    """Poses of all frames of one world: rotation row by row, and position [m], (f, 12)."""

    def __init__(self) -> None:
        """None yet; one row, as a kernel takes no empty array."""
        self.count = 0
        self.handles: list[Frame] = []
        self.present = np.zeros((1, 12), dtype=np.float32)
        self.coming = self.present.copy()  # at the end of the coming step
        self.has_work = False  # some pinned particle has somewhere to go, or has just arrived

    def add(self, frame: Frame, pose: NDArray[np.float32]) -> int:
        """The number of a new frame."""
        self.handles.append(frame)
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


class Frame(Handle):
    """A place that moves as the engine says: a bone, a vehicle, a hand. Made by `World.add_frame`."""

    def __init__(self, frames: Frames, position: ArrayLike, rotation: Any) -> None:
        """Made by `World.add_frame`."""
        self._frames = frames
        self._number = frames.add(self, _pose(position, rotation))

    @classmethod
    def at(cls, frames: Frames, number: int) -> Frame:
        """A handle to a frame that there is."""
        frame = cls.__new__(cls)
        frame._frames, frame._number = frames, number
        return frame

    def __repr__(self) -> str:
        if not self.is_alive:
            return f"Frame({self._number}, removed)"
        return f"Frame({self._number}, position={self.position.round(3).tolist()})"

    @property
    def is_alive(self) -> bool:
        """False once the world was put back to a state without it."""
        handles = self._frames.handles
        return self._number < len(handles) and handles[self._number] is self

    def _require_alive(self) -> None:
        if not self.is_alive:
            raise StateError(f"frame {self._number} is not in the state that was restored: add another")

    @property
    def position(self) -> NDArray[np.float32]:
        """Where its origin is after the last step, (3,) [m]."""
        self._require_alive()
        return np.array(self._frames.present[self._number, 9:])

    @property
    def rotation(self) -> NDArray[np.float32]:
        """Its axes after the last step, as columns, (3, 3)."""
        self._require_alive()
        return np.array(self._frames.present[self._number, :9].reshape(3, 3))

    @recorded
    def move_to(self, position: ArrayLike, rotation: ArrayLike | None = None) -> None:
        """Say where it is at the end of the coming step; it stays there until it is moved again.

        Args:
            position: of its origin, (3,) [m].
            rotation: matrix (3, 3) or quaternion (x, y, z, w); None keeps its axes as they are.
        Raises: OptionError for bad numbers.
        """
        self._require_alive()
        axes = self._frames.coming[self._number, :9].copy()
        pose = _pose(position, rotation)
        if rotation is None:
            pose[:9] = axes
        self._frames.coming[self._number] = pose


def _pose(position: ArrayLike, rotation: Any) -> NDArray[np.float32]:
    place = as_vector(position, "position", "m")
    return np.concatenate([as_rotation(rotation).ravel(), place]).astype(np.float32)
