"""How large a bake becomes, told before anything is simulated."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Room:
    """What a bake will take."""

    frames: int  # of the clip
    vertices: int  # of all meshes that are there
    size: int  # of positions and normals [bytes]; what does not move takes less

    def __str__(self) -> str:
        return f"{self.frames:,} frames of {self.vertices:,} vertices, about {self.size / 1e6:,.1f} MB"
