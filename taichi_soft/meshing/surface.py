"""A triangle surface with its normals and appearance, read from a file or made by a program."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.meshing.arrays import FloatArray, IntArray, as_indices, as_points, read_only


@dataclass(frozen=True, eq=False)
class Surface:
    """One mesh of a file or of a program."""

    name: str
    vertices: FloatArray  # (n, 3) [m]
    triangles: IntArray  # (m, 3)
    normals: FloatArray  # (n, 3), of unit length
    visual: Any = None  # trimesh visual with texture coordinates, material or colours, or None
    notes: tuple[str, ...] = ()  # messages about what the reader assumed, repaired or skipped


def surface_of(
    name: str,
    vertices: ArrayLike,
    triangles: ArrayLike,
    *,
    normals: FloatArray | None = None,
    visual: Any = None,
    notes: tuple[str, ...] = (),
) -> Surface:
    """Make a surface from copies of the arrays, after checking them.

    Args:
        normals: (n, 3), of any length. Normals that are None, NaN or 0 are computed from the triangles.
    Raises: MeshError for invalid vertices or triangles.
    """
    points = as_points(vertices)
    corners = as_indices(triangles, "triangles", 3, len(points), "triangle", may_repeat=True)
    if normals is None:
        rows = vertex_normals(points, corners)
    else:
        with np.errstate(over="ignore"):
            lengths = np.linalg.norm(normals, axis=1)
        is_missing = ~((lengths > 0.0) & np.isfinite(lengths))
        rows = np.where(is_missing[:, None], 1.0, normals)
        if is_missing.any():
            rows[is_missing] = vertex_normals(points, corners)[is_missing]
        rows = unit(rows)
    return Surface(name, read_only(points), read_only(corners), read_only(rows), visual, notes)


def joined(surfaces: tuple[Surface, ...]) -> tuple[FloatArray, NDArray[np.int64]]:
    """Concatenate surfaces. Returns: vertices (n, 3) [m] and triangles (m, 3)."""
    starts = np.cumsum([0, *(len(each.vertices) for each in surfaces)])[:-1]
    triangles = [
        each.triangles.astype(np.int64) + start for each, start in zip(surfaces, starts, strict=True)
    ]
    return np.concatenate([each.vertices for each in surfaces]), np.concatenate(triangles)


def vertex_normals(points: FloatArray, triangles: NDArray[Any]) -> FloatArray:
    """Return the unit normals of vertices, (n, 3).

    A normal is the mean of the normals of the triangles around the vertex, weighted by their angles at the
    vertex.
    """
    corners = points[triangles]
    to_next, to_previous = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    across = np.cross(to_next, to_previous)  # along the normal, at each corner
    size = np.linalg.norm(across, axis=2)
    angles = np.where(size > 0.0, np.arctan2(size, np.einsum("tcx,tcx->tc", to_next, to_previous)), 0.0)
    weighted = (angles[:, :, None] * unit(across)).reshape(-1, 3)
    sums = [np.bincount(triangles.ravel(), weighted[:, k], len(points)) for k in range(3)]
    return unit(np.stack(sums, axis=1))


def unit(rows: NDArray[Any]) -> FloatArray:
    """Return rows scaled to length 1. A row of length 0 becomes (0, 0, 1)."""
    lengths = np.linalg.norm(rows, axis=-1, keepdims=True)
    return np.where(lengths > 0, rows / np.where(lengths > 0, lengths, 1.0), [0.0, 0.0, 1.0])
