"""Store the newest frame of a world in shared memory. The writer never waits for a reader."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

PLACES = 3
"""Number of buffers for frames. While one is read and one is written, a third has the newest complete
frame."""

_HEAD = np.dtype([("newest", "<i8"), ("pad", "<i8", 7)])
_FRAME = np.dtype([("number", "<i8"), ("version", "<i8"), ("time", "<f8"), ("is_tinted", "<i8")])

TRIES = 8
"""Number of attempts to read a frame. If all attempts fail, the reader skips the frame. An attempt fails if
the writer overwrites the frame during the attempt."""


@dataclass(frozen=True)
class Frame:
    """Positions of all bodies and colliders at one time.

    Attributes:
        positions, normals: positions [m] and unit normals of all n render vertices, float32 (n, 3).
        tints: indices of the vertices into a colour scale, uint8 (n,).
        poses: rotation by rows and position [m] of each of k colliders, float32 (k, 12).
    """

    number: int
    version: int  # version of the meshes, see `Drawn`
    time: float  # world time [s]
    is_tinted: bool
    positions: NDArray[np.float32]
    normals: NDArray[np.float32]
    tints: NDArray[np.uint8]
    poses: NDArray[np.float32]


class FrameFile:
    """A memory-mapped file with buffers for frames of `vertices` vertices and `colliders` colliders."""

    def __init__(self, path: Path, vertices: int, colliders: int, *, is_new: bool = False) -> None:
        size = _FRAME.itemsize + vertices * (24 + 1) + 48 * colliders
        stride = -(-size // 64) * 64
        shape = (_HEAD.itemsize + PLACES * stride,)
        self._memory = np.memmap(path, dtype=np.uint8, mode="w+" if is_new else "r+", shape=shape)
        self._newest = self._memory[: _HEAD.itemsize].view(_HEAD)["newest"]
        self._vertices, self._colliders = vertices, colliders
        self._places = [
            self._views(self._memory[_HEAD.itemsize + i * stride :][:stride]) for i in range(PLACES)
        ]

    def _views(self, rows: NDArray[np.uint8]) -> tuple[NDArray[np.void], Frame]:
        head, at, n = rows[: _FRAME.itemsize].view(_FRAME), _FRAME.itemsize, self._vertices
        positions = rows[at : at + 12 * n].view("<f4").reshape(n, 3)
        normals = rows[at + 12 * n : at + 24 * n].view("<f4").reshape(n, 3)
        poses = rows[at + 24 * n : at + 24 * n + 48 * self._colliders].view("<f4").reshape(-1, 12)
        tints = rows[at + 24 * n + 48 * self._colliders :][:n]
        return head, Frame(0, 0, 0.0, False, positions, normals, tints, poses)

    @property
    def newest_number(self) -> int:
        """Number of the newest frame; 0 if there is none yet."""
        return int(self._newest[0])

    def begin(self) -> Frame:
        """Return the arrays of the next frame. Fill them before you call `publish`."""
        number = self.newest_number + 1
        head, frame = self._places[number % PLACES]
        head["number"] = -1  # marks the buffer as incomplete for readers
        return frame

    def publish(self, version: int, time: float, *, is_tinted: bool) -> int:
        """Publish the filled arrays as the newest frame. Returns: the number of the frame, counted from 1."""
        number = self.newest_number + 1
        head = self._places[number % PLACES][0]
        head["version"], head["time"], head["is_tinted"] = version, time, is_tinted
        head["number"] = number
        self._newest[0] = number
        return number

    def newest(self) -> Frame | None:
        """Return a copy of the newest frame; None if there is none yet or all attempts to read it failed."""
        for _ in range(TRIES):
            number = self.newest_number
            if number == 0:
                return None
            head, frame = self._places[number % PLACES]
            if head["number"][0] != number:
                continue
            found = Frame(
                number,
                int(head["version"][0]),
                float(head["time"][0]),
                bool(head["is_tinted"][0]),
                *(each.copy() for each in (frame.positions, frame.normals, frame.tints, frame.poses)),
            )
            if head["number"][0] == number:
                return found
        return None
