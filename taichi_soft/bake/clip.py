"""Clips, the input of all bake formats. A clip is a mesh with its motion."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]
Ints32 = NDArray[np.int32]


@dataclass(eq=False)
class Clip:
    """A render mesh of a body, for all frames in which the body is in the world.

    If nothing moved, a frame refers to the same array objects as the frame before it.
    """

    name: str  # unique name of the mesh
    triangles: Ints32  # vertex indices, (m, 3)
    visual: Any  # `visual` of trimesh, or None
    first: int  # frame of the bake in which the body appears
    positions: list[Floats32] = field(default_factory=list)  # one array per frame, (k, 3) [m], z up
    normals: list[Floats32] = field(default_factory=list)  # one array per frame, (k, 3), unit vectors

    @property
    def vertex_count(self) -> int:
        """Number of vertices, k."""
        return len(self.positions[0])

    @property
    def end(self) -> int:
        """Number of the frame after the last frame in which the body is in the world."""
        return self.first + len(self.positions)

    @property
    def uv(self) -> Floats | None:
        """Texture coordinates (k, 2) from the lower left; None if the mesh has no texture coordinates."""
        uv = getattr(self.visual, "uv", None)
        if uv is None or len(uv) != self.vertex_count:
            return None
        return np.asarray(uv, dtype=np.float64)[:, :2]

    def add(self, positions: Floats32, normals: Floats32) -> None:
        """Append the positions and normals of the next frame."""
        is_same = self.positions and np.array_equal(positions, self.positions[-1])
        if is_same and np.array_equal(normals, self.normals[-1]):
            positions, normals = self.positions[-1], self.normals[-1]
        self.positions.append(positions)
        self.normals.append(normals)

    def is_there(self, frame: int) -> bool:
        """True if the body is in the world at a frame of the bake."""
        return self.first <= frame < self.end

    def at(self, frame: int) -> tuple[Floats32, Floats32]:
        """Return positions and normals at a frame of the bake, (k, 3) each.

        If the body is absent in this frame, return the positions and normals of the nearest frame with the
        body.
        """
        index = min(max(frame - self.first, 0), len(self.positions) - 1)
        return self.positions[index], self.normals[index]

    def targets(self) -> tuple[list[int], list[int]]:
        """Find the distinct shapes of the clip, except the shape of the first frame.

        Returns: a list with the frame in which each of these shapes first occurs; and for each frame, the
            index of its shape in this list, or -1 for the shape of the first frame.
        """
        shapes, place, current = [], [-1], -1
        for index in range(1, len(self.positions)):
            before = index - 1
            same = self.positions[index] is self.positions[before]
            if not (same and self.normals[index] is self.normals[before]):
                shapes.append(index)
                current = len(shapes) - 1
            place.append(current)
        return shapes, place


@dataclass(frozen=True)
class Take:
    """All clips of a bake."""

    clips: tuple[Clip, ...]
    frame_count: int
    fps: float
    left_out: tuple[str, ...]  # names of bodies without triangles

    @property
    def times(self) -> Floats:
        """Times of all frames, measured from the first frame [s]."""
        return np.arange(self.frame_count) / self.fps

    @property
    def vertex_count(self) -> int:
        """Number of vertices of all clips."""
        return sum(clip.vertex_count for clip in self.clips)
