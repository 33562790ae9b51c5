"""Write a point cache for NumPy: every vertex in every frame.

| array | shape | content |
|---|---|---|
| positions | (frames, vertices, 3) float32 | vertices of all meshes, concatenated [m]; z is up |
| normals | (frames, vertices, 3) float32 | unit normals |
| triangles | (triangles, 3) int32 | vertex indices, counterclockwise seen from outside |
| uvs | (vertices, 2) float32 | texture coordinates from the lower left; NaN for meshes without them |
| times | (frames,) float64 | time since the first frame [s] |
| names | (meshes,) | names of the meshes |
| vertex_starts, triangle_starts | (meshes + 1,) int64 | start of each mesh, and end of the last one |
| is_there | (frames, meshes) bool | false if the body is absent; then the nearest frame is repeated |
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from taichi_soft.bake.clip import Clip, Take


def write_npz(take: Take, path: Path) -> None:
    """Write a take as an .npz file with the arrays that the docstring of this module lists."""
    clips = take.clips
    starts = np.cumsum([0, *(clip.vertex_count for clip in clips)])
    shape = take.frame_count, take.vertex_count, 3
    positions, normals = np.empty(shape, dtype=np.float32), np.empty(shape, dtype=np.float32)
    for frame in range(take.frame_count):
        for clip, start, end in zip(clips, starts, starts[1:], strict=False):
            positions[frame, start:end], normals[frame, start:end] = clip.at(frame)
    with path.open("wb") as file:
        np.savez(
            file,
            positions=positions,
            normals=normals,
            triangles=np.concatenate([c.triangles + s for c, s in zip(clips, starts, strict=False)]).astype(
                np.int32
            ),
            uvs=np.concatenate([_uv(clip) for clip in clips]),
            times=take.times,
            names=np.array([clip.name for clip in clips]),
            vertex_starts=starts,
            triangle_starts=np.cumsum([0, *(len(clip.triangles) for clip in clips)]),
            is_there=np.array([[c.is_there(f) for c in clips] for f in range(take.frame_count)]),
        )


def _uv(clip: Clip) -> np.ndarray:
    uv = clip.uv
    return (np.full((clip.vertex_count, 2), np.nan) if uv is None else uv).astype(np.float32)
