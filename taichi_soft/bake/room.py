"""Estimate of the size of a bake."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Room:
    """Number of frames and vertices, and estimated size of a bake."""

    frames: int  # number of frames of the clip
    vertices: int  # number of vertices of all current meshes
    size: int  # estimated size of positions and normals [bytes]; bodies at rest need less

    def __str__(self) -> str:
        return f"{self.frames:,} frames of {self.vertices:,} vertices, about {self.size / 1e6:,.1f} MB"
