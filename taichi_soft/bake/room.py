"""Estimated size of a bake."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Room:
    """Frames, vertices and estimated size of a bake."""

    frames: int  # of the clip
    vertices: int  # of all current meshes
    size: int  # of positions and normals [bytes]; bodies at rest take less

    def __str__(self) -> str:
        return f"{self.frames:,} frames of {self.vertices:,} vertices, about {self.size / 1e6:,.1f} MB"
