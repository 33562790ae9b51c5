"""Shapes swept from a flat triangulation in layers of prisms. A prism consists of three tetrahedra."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.core.checks import as_count, as_positive
from taichi_soft.core.errors import OptionError
from taichi_soft.meshing.arrays import FloatArray, as_indices, as_points, require_tet_count
from taichi_soft.meshing.tet_mesh import TetMesh


def extrude(points: ArrayLike, triangles: ArrayLike, layers: int = 1, height: float = 1.0) -> TetMesh:
    """Extrude a flat triangulation along z, from -height/2 to height/2.

    Args:
        points: (n, 2) points in the plane [m]. The bounding box of the result is centred at the origin.
        triangles: (t, 3) vertex indices, in either orientation.
        layers: number of layers of prisms.
        height: total height [m].
    Raises: MeshError if the arrays do not make a mesh; OptionError for a count below 1 or a height that is
        not positive.
    """
    flat = as_points(points, "points", 2)
    corners = as_indices(triangles, "triangles", 3, len(flat), "triangle")
    layers, height = as_count(layers, "layers"), as_positive(height, "height", "m")
    require_tet_count(3 * len(corners) * layers)
    flat -= (flat.min(axis=0) + flat.max(axis=0)) / 2.0
    levels = np.linspace(-height / 2.0, height / 2.0, layers + 1)
    vertices = np.column_stack([np.tile(flat, (layers + 1, 1)), np.repeat(levels, len(flat))])
    return TetMesh(vertices, _prism_tets(corners, len(flat), layers, layers + 1), fix_orientation=True)


def cylinder(radius: float = 0.5, height: float = 1.0, rings: int = 3, layers: int = 4) -> TetMesh:
    """Make a cylinder along z, centred at the origin.

    Args:
        radius: radius of the circle through the outer vertices [m].
        height: height along z [m].
        rings: number of concentric rings of 6, 12, 18, ... points around the axis, evenly spaced.
        layers: number of layers. Tetrahedra have the best shape if height / layers is close to radius /
            rings. The smallest dihedral angle is then 35 to 41 degrees.
    Raises: OptionError for sizes that are not positive or counts below 1.
    """
    rings, layers = as_count(rings, "rings"), as_count(layers, "layers")
    require_tet_count(18 * rings**2 * layers)
    flat, triangles = _disc(rings)
    return extrude(as_positive(radius, "radius", "m") * flat, triangles, layers, height)


def torus(
    major_radius: float = 1.0, minor_radius: float = 0.3, rings: int = 2, segments: int = 40
) -> TetMesh:
    """Make a torus around the z axis, centred at the origin.

    Args:
        major_radius: radius of the circle in the plane z = 0 that the tube follows [m].
        minor_radius: radius of the tube [m], less than `major_radius`.
        rings: number of concentric rings of points in the tube's cross-section, as in `cylinder`.
        segments: number of segments around the axis, 3 or more. Tetrahedra have the best shape if
            2 pi major_radius / segments is close to minor_radius / rings. At the default proportions, the
            smallest dihedral angle is 31 degrees.
    Raises: OptionError for sizes that are not positive, a minor radius that is not below the major radius, or
        counts that are too low.
    """
    major = as_positive(major_radius, "major_radius", "m")
    minor = as_positive(minor_radius, "minor_radius", "m")
    if minor >= major:
        raise OptionError(f"minor_radius is {minor:g} and major_radius {major:g}: the minor must be smaller")
    segments, rings = as_count(segments, "segments", 3), as_count(rings, "rings")
    require_tet_count(18 * rings**2 * segments)
    flat, triangles = _disc(rings)
    angle = np.repeat(np.arange(segments) * (2.0 * np.pi / segments), len(flat))
    across, up = np.tile(minor * flat, (segments, 1)).T
    vertices = np.column_stack([(major + across) * np.cos(angle), (major + across) * np.sin(angle), up])
    return TetMesh(vertices, _prism_tets(triangles, len(flat), segments, segments), fix_orientation=True)


def _disc(rings: int) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return the points (n, 2) and triangles (6 * rings**2, 3) of a unit disc.

    The points are the centre and 6 k points in ring k, from k = 1.
    """
    angles = [np.arange(6 * k) * (np.pi / (3 * k)) for k in range(1, rings + 1)]
    points = [np.zeros((1, 2))]
    points += [np.column_stack([np.cos(a), np.sin(a)]) * (k + 1) / rings for k, a in enumerate(angles)]
    triangles = []
    for k in range(1, rings + 1):
        outer, inner = 3 * k * (k - 1) + 1, 3 * (k - 1) * (k - 2) + 1
        for sector in range(6):
            # In each sixth of the circle, ring k has k steps, and the next inner ring has k - 1 steps.
            outside = outer + (sector * k + np.arange(k + 1)) % (6 * k)
            inside = inner + (sector * (k - 1) + np.arange(k)) % (6 * (k - 1)) if k > 1 else np.zeros(1, int)
            triangles.append(np.column_stack([outside[:-1], outside[1:], inside]))
            triangles.append(np.column_stack([inside[:-1], outside[1:-1], inside[1:]]))
    return np.concatenate(points), np.concatenate(triangles)


def _prism_tets(triangles: NDArray[np.integer], stride: int, layers: int, levels: int) -> NDArray[np.int64]:
    """Return three tetrahedra for each prism between one level and the next, (t, 4).

    If there are as many layers as levels, the first level follows the last. Vertex i of the triangulation has
    the number i + level * stride. The diagonal of a prism's side face starts at the bottom vertex with the
    lower number. Neighbouring prisms use the same diagonal, so their faces match.
    """
    a, b, c = np.sort(triangles.astype(np.int64), axis=1).T
    level = np.arange(layers)[:, None] * stride
    above = (np.arange(layers)[:, None] + 1) % levels * stride
    first = np.stack([a + level, b + level, c + level, c + above], axis=2)
    second = np.stack([a + level, b + level, b + above, c + above], axis=2)
    third = np.stack([a + level, a + above, b + above, c + above], axis=2)
    return np.concatenate([first, second, third], axis=1).reshape(-1, 4)
