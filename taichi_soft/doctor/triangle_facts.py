"""Find faults in the triangles of a surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from taichi_soft.cages.connected import components
from taichi_soft.meshing.surface import Surface, joined
from taichi_soft.meshing.welding import places_of

NO_AREA = 1e-12
"""A triangle counts as having no area if twice its area is at most this number times the square of the
surface's longest side."""


@dataclass(frozen=True)
class SurfaceFacts:
    """Counts for all meshes of a file together, after vertices at the same position have been merged."""

    meshes: int
    vertices: int
    triangles: int
    parts: int  # connected components by shared vertices
    size: float  # longest side of the bounding box [m]
    open_edges: int  # edges that belong to only one triangle
    crowded_edges: int  # edges that belong to more than two triangles
    turned_edges: int  # edges that both adjacent triangles traverse in the same direction
    flat_triangles: int  # triangles without area
    repeated_triangles: int


def facts_of(surfaces: tuple[Surface, ...]) -> SurfaceFacts:
    """Count the triangles, parts and faults of several surfaces together."""
    vertices, triangles = joined(surfaces)
    size = float(np.ptp(vertices[np.unique(triangles)], axis=0).max())
    welded = places_of(vertices, size)[triangles]
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    doubled = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    is_flat = (doubled <= NO_AREA * size**2) | (np.diff(np.sort(welded, axis=1), axis=1) == 0).any(axis=1)
    sound = welded[~is_flat]
    unique = np.unique(np.sort(sound, axis=1), axis=0)
    ends = sound[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    edges, edge = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
    uses = np.bincount(edge.reshape(-1), minlength=len(edges))
    balance = np.bincount(edge.reshape(-1), np.where(ends[:, 0] < ends[:, 1], 1.0, -1.0), len(edges))
    used, rows = np.unique(sound, return_inverse=True)
    rows = rows.reshape(-1, 3)
    parts = components(len(used), np.concatenate([rows[:, :2], rows[:, 1:]]))
    return SurfaceFacts(
        len(surfaces),
        len(vertices),
        len(triangles),
        int(parts.max(initial=-1)) + 1,
        size,
        int((uses == 1).sum()),
        int((uses > 2).sum()),
        int(((uses == 2) & (balance != 0)).sum()),
        int(is_flat.sum()),
        len(sound) - len(unique),
    )
