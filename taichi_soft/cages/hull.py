"""The hull of an artist's mesh, used for contact: points on the mesh, and triangles between these points.

The surface is divided into patches. A patch consists of the vertices that lie in the same cell of a grid and
face the same direction. The most prominent vertex of each patch becomes a hull point. The hull therefore
keeps tips and both sides of a sheet, and all hull points lie on the surface. Objects that pass between hull
points penetrate by a small fraction of the distance between the points.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.cages.solid import solid_of
from taichi_soft.core.checks import as_count
from taichi_soft.core.errors import MeshError, OptionError
from taichi_soft.core.serialisation import serialised
from taichi_soft.meshing.arrays import FloatArray, as_indices, as_points, read_only
from taichi_soft.meshing.surface import Surface, joined
from taichi_soft.meshing.surfaces import read_surfaces

Ints = NDArray[np.int64]

MIN_POINTS, MAX_POINTS = 12, 20_000
"""Smallest and largest number of points of a hull."""

POINTS_PER_VERTEX = 2.0
"""Default number of hull points per outer vertex of the tetrahedra. With this number, round shapes penetrate
by 2 % of their size."""

VOXELS = 64
"""Number of voxels along the longest side of the grid that separates inside and outside."""

STEPS = 1.0, 2.0, 3.0
"""Distances from a triangle at which fills are read in front of and behind it, in voxels. The fills on each
side are averaged, because single voxels can be wrong near triangles of wrong orientation."""

INNER, FLIP_MARGIN = 0.95, 0.25
"""Limits of the mean fill at the sides of a triangle. INNER: the triangle is dropped if the fill is at least
this value on both sides. FLIP_MARGIN: the triangle is flipped if the fill in front exceeds the fill behind by
more than this value."""

DIRECTIONS = 0.5
"""Number of directions in which the farthest vertex becomes a hull point, divided by the number of hull
points."""

HALVINGS = 14
"""Number of bisection steps in the search for the cell size."""


@serialised("points", "triangles")
@dataclass(frozen=True, eq=False)
class Hull:
    """Points on a surface, and outward-facing triangles between the points.

    Args:
        points: (h, 3) [m].
        triangles: (t, 3), indices of points. A point need not belong to a triangle.
    Raises: MeshError for invalid arrays.
    """

    points: FloatArray
    triangles: NDArray[np.int32]

    def __post_init__(self) -> None:
        points = as_points(self.points)
        corners = as_indices(self.triangles, "triangles", 3, len(points), "triangle", may_repeat=False)
        if not np.ptp(points[corners].reshape(-1, 3), axis=0).max() > 0.0:
            raise MeshError("hull has no extent: the corners of its triangles all coincide")
        object.__setattr__(self, "points", read_only(points))
        object.__setattr__(self, "triangles", read_only(corners.astype(np.int32)))


def as_hull(request: Any, surfaces: tuple[Surface, ...], outer: int) -> Hull | None:
    """Make a hull from the argument `hull` of `SoftBodyAsset`. For None, return None.

    Args:
        request: None, True, a number of points, a surface as for `read_surfaces`, or a hull.
        surfaces: skin of the asset.
        outer: number of vertices on the surface of the tetrahedra. If `request` is True, the number of points
            is derived from it.
    Raises: OptionError if a number is out of range or there are no surfaces; MeshError for an invalid
        surface.
    """
    if request is None or isinstance(request, Hull):
        return request
    if request is True:
        request = min(max(round(POINTS_PER_VERTEX * outer), MIN_POINTS), MAX_POINTS)
    if isinstance(request, (bool, int, float, np.number)):
        if not surfaces:
            raise OptionError(
                f"hull={request!r} takes its points from the skin, but there is no skin: pass one, or a "
                "surface as hull"
            )
        return hull_of(surfaces, request)
    points, triangles = joined(read_surfaces(request))
    if len(points) > MAX_POINTS:
        raise OptionError(f"hull has {len(points):,} vertices: pass at most {MAX_POINTS:,}, or a number")
    return Hull(points, triangles.astype(np.int32))


def hull_of(surfaces: tuple[Surface, ...], count: Any) -> Hull:
    """Make a hull of at most `count` points.

    Raises: OptionError if `count` is out of range; MeshError for a surface without extent.
    """
    max_points = as_count(count, "hull", MIN_POINTS, MAX_POINTS)
    vertices, triangles = _outward(*joined(surfaces))
    edges = vertices[triangles[:, 1:]] - vertices[triangles[:, :1]]
    area = 0.5 * float(np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum())
    if not area > 0.0:
        raise MeshError("the surface has no area to make a hull of")
    cell = np.sqrt(area / max_points)  # a flat surface would then have about `max_points` patches
    vertices, triangles = _subdivided(vertices, triangles, 0.5 * cell)
    normals, tips = _normals(vertices, triangles), _tips(vertices, round(DIRECTIONS * max_points))
    low, high = 0.5 * cell, max(8.0 * cell, 1.1 * float(np.ptp(vertices, axis=0).max()))
    for _ in range(HALVINGS):
        middle = np.sqrt(low * high)
        if len(_chosen(vertices, normals, tips, middle)[0]) <= max_points:
            high = middle
        else:
            low = middle
    chosen, patch = _chosen(vertices, normals, tips, high)
    corners = _nearest(vertices, triangles, chosen, patch)[triangles]
    return Hull(vertices[chosen], _without_fins(_distinct_triangles(corners)).astype(np.int32))


def _nearest(vertices: FloatArray, triangles: Ints, chosen: Ints, patch: Ints) -> Ints:
    """Return for each vertex the index in `chosen` of the chosen vertex that is nearest along edges, (n,).

    If no path leads to a chosen vertex, the result is the number in `patch`. With this assignment, the
    triangles between hull points are well oriented. With `patch` as the assignment, triangles would fold over
    if the chosen vertex of a patch lies at the rim of the patch.
    """
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    edges = np.unique(np.concatenate([edges, edges[:, ::-1]]), axis=0)
    lengths = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    owner, distance = patch.copy(), np.full(len(vertices), np.inf)
    owner[chosen], distance[chosen] = np.arange(len(chosen)), 0.0
    is_changing = True
    while is_changing:  # Bellman-Ford iterations
        path_length = distance[edges[:, 0]] + lengths
        order = np.lexsort((owner[edges[:, 0]], path_length, edges[:, 1]))
        ends = edges[order, 1]
        first = order[np.r_[True, ends[1:] != ends[:-1]]]
        first = first[path_length[first] < distance[edges[first, 1]]]
        is_changing = len(first) > 0
        distance[edges[first, 1]] = path_length[first]
        owner[edges[first, 1]] = owner[edges[first, 0]]
    return np.asarray(owner, dtype=np.int64)


def _chosen(vertices: FloatArray, normals: FloatArray, tips: Ints, cell: float) -> tuple[Ints, Ints]:
    """Return the vertices that become hull points, (h,), and the patch of each vertex, (n,).

    The first hull points represent the patches of size `cell` [m], in order. The other hull points are tips.
    """
    patches, patch = np.unique(_patches(vertices, normals, cell), return_inverse=True)
    patch = patch.reshape(-1)
    representatives = _representatives(vertices, normals, tips, patch, len(patches))
    others = np.setdiff1d(np.flatnonzero(tips), representatives)
    return np.concatenate([representatives, others]), patch


def _outward(vertices: FloatArray, triangles: Ints) -> tuple[FloatArray, Ints]:
    """Merge coincident vertices, turn triangles outwards, and drop triangles with solid on both sides.

    Returns: vertices (k, 3) [m], triangles (j, 3).
    """
    positions, numbers = np.unique(vertices, axis=0, return_inverse=True)
    corners = numbers.reshape(-1)[triangles]
    is_flat = (corners == np.roll(corners, 1, axis=1)).any(axis=1)
    corners = corners[~is_flat]
    if not len(corners):
        raise MeshError("the surface has no area to make a hull of")
    spacing = float(np.ptp(positions[corners].reshape(-1, 3), axis=0).max()) / VOXELS
    solid = solid_of(positions, corners, spacing)
    x = positions[corners]
    normals = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)

    def inside(points: FloatArray) -> FloatArray:
        voxel = np.floor((points - solid.origin) / solid.spacing).astype(np.int64)
        is_in = ((voxel >= 0) & (voxel < solid.fill.shape)).all(axis=1)
        found = np.zeros(len(points))
        found[is_in] = solid.fill[tuple(voxel[is_in].T)]
        return found

    middles = x.mean(axis=1)
    before, behind = (
        np.mean([inside(middles + sign * step * spacing * normals) for step in STEPS], axis=0)
        for sign in (1.0, -1.0)
    )
    oriented = np.where((before > behind + FLIP_MARGIN)[:, None], corners[:, ::-1], corners)
    is_outer = np.minimum(before, behind) < INNER
    used, numbers = np.unique(oriented[is_outer] if is_outer.any() else oriented, return_inverse=True)
    return positions[used], numbers.reshape(-1, 3)


def _subdivided(vertices: FloatArray, triangles: Ints, longest: float) -> tuple[FloatArray, Ints]:
    """Subdivide the surface until no edge is longer than `longest` [m]."""
    from trimesh.remesh import subdivide_to_size  # imported here because games do not need this slow import

    x = vertices[triangles]
    most = float(np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2).max())
    if most > longest:
        rounds = int(np.ceil(np.log2(most / longest))) + 2
        vertices, triangles = subdivide_to_size(vertices, triangles, longest, max_iter=rounds)
        vertices, numbers = np.unique(vertices, axis=0, return_inverse=True)
        triangles = numbers.reshape(-1)[triangles]
    return np.asarray(vertices, dtype=np.float64), np.asarray(triangles, dtype=np.int64)


def _normals(vertices: FloatArray, triangles: Ints) -> FloatArray:
    """Return the area-weighted unit normals of vertices, (n, 3). Vertices without triangles have normal 0."""
    x = vertices[triangles]
    areas = np.repeat(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), 3, axis=0)
    sums = [np.bincount(triangles.ravel(), areas[:, k], len(vertices)) for k in range(3)]
    normals = np.stack(sums, axis=1)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(lengths > 0, normals / np.where(lengths > 0, lengths, 1.0), 0.0)


def _patches(vertices: FloatArray, normals: FloatArray, cell: float) -> Ints:
    """Return a patch number for each vertex, (n,). It encodes the grid cell and the direction of the normal.

    The direction is the positive or negative axis nearest to the normal.
    """
    cells = np.floor((vertices - vertices.min(axis=0)) / cell).astype(np.int64)
    axis = np.abs(normals).argmax(axis=1)
    direction = 2 * axis + (normals[np.arange(len(normals)), axis] < 0.0)
    size = cells.max(axis=0) + 1
    return np.asarray(np.ravel_multi_index((*cells.T, direction), (*size, 6)), dtype=np.int64)


def _tips(vertices: FloatArray, count: int) -> Ints:
    """Count in how many of `count` evenly spread directions each vertex is the farthest, (n,)."""
    number = np.arange(count) + 0.5
    height, angle = 1.0 - 2.0 * number / count, np.pi * (1.0 + np.sqrt(5.0)) * number
    radius = np.sqrt(1.0 - height**2)
    directions = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
    farthest = [int((vertices @ direction).argmax()) for direction in directions]
    return np.bincount(farthest, minlength=len(vertices))


def _representatives(vertices: FloatArray, normals: FloatArray, tips: Ints, patch: Ints, count: int) -> Ints:
    """Return for each patch the vertex that is the farthest in the most directions, (count,).

    A tie is decided by the position along the patch's mean normal.
    """
    means = np.stack([np.bincount(patch, normals[:, k], count) for k in range(3)], axis=1)
    height = np.einsum("nk,nk->n", vertices, means[patch])
    order = np.lexsort((np.arange(len(patch)), -height, -tips, patch))
    first = np.r_[True, patch[order][1:] != patch[order][:-1]]
    return order[first]


def _distinct_triangles(corners: Ints) -> Ints:
    """Remove degenerate and duplicate triangles."""
    is_flat = (corners == np.roll(corners, 1, axis=1)).any(axis=1)
    corners = corners[~is_flat]
    lead = corners.argmin(axis=1)
    rows = np.arange(len(corners))[:, None]
    return np.unique(corners[rows, (lead[:, None] + np.arange(3)) % 3], axis=0).reshape(-1, 3)


def _without_fins(triangles: Ints) -> Ints:
    """Remove triangles that share all corners with another triangle: such pairs enclose nothing.

    If no triangle would be left, return all triangles.
    """
    corners = np.sort(triangles, axis=1)
    _, number, count = np.unique(corners, axis=0, return_inverse=True, return_counts=True)
    is_single = count[number.reshape(-1)] == 1
    return triangles[is_single] if is_single.any() else triangles
