"""The hull of an artist's mesh: some points on it, and triangles between them, that stand for it in contact.

The surface is cut into patches, the vertices of one cell of a grid that face the same way, and each patch has
one point: the vertex that stands out most. So tips and the two sides of a sheet stay, all points lie on the
surface, and what passes between them passes a small part of their distance under it.
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

FEWEST, MOST = 12, 20_000
"""Points of a hull."""

ENOUGH = 2.0
"""Points over the outer vertices of the tetrahedra. With as many as these, what is round sinks in by 2 % of
its size."""

VOXELS = 64
"""Along the longest side, by which it is told where the inside is."""

STEPS = 1.0, 2.0, 3.0
"""Voxels before and behind a triangle of which the mean tells: where some triangles face the wrong way, not
every voxel is right."""

INNER, CLEARLY = 0.95, 0.25
"""Mean from which all there counts as inside; and by how much more of what is before a triangle than of what
is behind it must be inside for the triangle to be turned round."""

DIRECTIONS = 0.5
"""Directions in which the farthest vertex is a point of the hull, over the number of points."""

HALVINGS = 14
"""Of the interval in which the edge of a cell is looked for."""


@serialised("points", "triangles")
@dataclass(frozen=True, eq=False)
class Hull:
    """Points on a surface, and triangles between them, facing outward.

    Args:
        points: (h, 3) [m].
        triangles: (t, 3), of the points. A point may belong to none.
    Raises: MeshError for arrays that are none of this.
    """

    points: FloatArray
    triangles: NDArray[np.int32]

    def __post_init__(self) -> None:
        points = as_points(self.points)
        corners = as_indices(self.triangles, "triangles", 3, len(points), "triangle", may_repeat=False)
        if not np.ptp(points[corners].reshape(-1, 3), axis=0).max() > 0.0:
            raise MeshError("hull has no extent: the corners of its triangles all lie in one place")
        object.__setattr__(self, "points", read_only(points))
        object.__setattr__(self, "triangles", read_only(corners.astype(np.int32)))


def as_hull(wanted: Any, surfaces: tuple[Surface, ...], outer: int) -> Hull | None:
    """The hull that `SoftBodyAsset` is asked for, of the surfaces that it carries.

    Args:
        wanted: None, True, a number of points, a surface as `read_surfaces` takes it, or a hull.
        outer: vertices on the surface of its tetrahedra, by which True chooses the number.
    Raises: OptionError for a number out of range, or without surfaces; MeshError for a bad surface.
    """
    if wanted is None or isinstance(wanted, Hull):
        return wanted
    if wanted is True:
        wanted = min(max(round(ENOUGH * outer), FEWEST), MOST)
    if isinstance(wanted, (bool, int, float, np.number)):
        if not surfaces:
            raise OptionError(
                f"hull is {wanted}, and there is no skin to take the points from: give a skin, or a surface "
                "as hull"
            )
        return hull_of(surfaces, wanted)
    points, triangles = joined(read_surfaces(wanted))
    if len(points) > MOST:
        raise OptionError(f"hull has {len(points):,} vertices: at most {MOST:,}, or give a number")
    return Hull(points, triangles.astype(np.int32))


def hull_of(surfaces: tuple[Surface, ...], count: Any) -> Hull:
    """A hull of at most `count` points.

    Raises: OptionError for a number out of range; MeshError for a surface without extent.
    """
    most = as_count(count, "hull", FEWEST, MOST)
    vertices, triangles = _outward(*joined(surfaces))
    edges = vertices[triangles[:, 1:]] - vertices[triangles[:, :1]]
    area = 0.5 * float(np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum())
    if not area > 0.0:
        raise MeshError("the surface has no area to make a hull of")
    cell = np.sqrt(area / most)  # of about as many patches, were it flat
    vertices, triangles = _divided(vertices, triangles, 0.5 * cell)
    normals, tips = _normals(vertices, triangles), _tips(vertices, round(DIRECTIONS * most))
    low, high = 0.5 * cell, max(8.0 * cell, 1.1 * float(np.ptp(vertices, axis=0).max()))
    for _ in range(HALVINGS):
        middle = np.sqrt(low * high)
        if len(_chosen(vertices, normals, tips, middle)[0]) <= most:
            high = middle
        else:
            low = middle
    chosen, patch = _chosen(vertices, normals, tips, high)
    corners = _nearest(vertices, triangles, chosen, patch)[triangles]
    return Hull(vertices[chosen], _without_fins(_between(corners)).astype(np.int32))


def _nearest(vertices: FloatArray, triangles: Ints, chosen: Ints, patch: Ints) -> Ints:
    """Which of the chosen vertices is nearest to each, along edges, (n,); or that of its patch, where no
    edges lead to one.

    Triangles between these lie round their corners. Those between patches fold over where a patch has its
    point at the rim.
    """
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    edges = np.unique(np.concatenate([edges, edges[:, ::-1]]), axis=0)
    lengths = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    owner, distance = patch.copy(), np.full(len(vertices), np.inf)
    owner[chosen], distance[chosen] = np.arange(len(chosen)), 0.0
    is_open = True
    while is_open:  # rounds of Bellman and Ford
        way = distance[edges[:, 0]] + lengths
        order = np.lexsort((owner[edges[:, 0]], way, edges[:, 1]))
        ends = edges[order, 1]
        first = order[np.r_[True, ends[1:] != ends[:-1]]]
        first = first[way[first] < distance[edges[first, 1]]]
        is_open = len(first) > 0
        distance[edges[first, 1]] = way[first]
        owner[edges[first, 1]] = owner[edges[first, 0]]
    return np.asarray(owner, dtype=np.int64)


def _chosen(vertices: FloatArray, normals: FloatArray, tips: Ints, cell: float) -> tuple[Ints, Ints]:
    """Vertices that stand for patches of a size [m], and behind them the other tips; patch of each vertex."""
    patches, patch = np.unique(_patches(vertices, normals, cell), return_inverse=True)
    patch = patch.reshape(-1)
    leaders = _leaders(vertices, normals, tips, patch, len(patches))
    others = np.setdiff1d(np.flatnonzero(tips), leaders)
    return np.concatenate([leaders, others]), patch


def _outward(vertices: FloatArray, triangles: Ints) -> tuple[FloatArray, Ints]:
    """Vertices that are one where they lie in one place, and triangles turned so that they face outward,
    without those that have the inside on both sides."""
    places, numbers = np.unique(vertices, axis=0, return_inverse=True)
    corners = numbers.reshape(-1)[triangles]
    is_flat = (corners == np.roll(corners, 1, axis=1)).any(axis=1)
    corners = corners[~is_flat]
    if not len(corners):
        raise MeshError("the surface has no area to make a hull of")
    spacing = float(np.ptp(places[corners].reshape(-1, 3), axis=0).max()) / VOXELS
    solid = solid_of(places, corners, spacing)
    x = places[corners]
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
    turned = np.where((before > behind + CLEARLY)[:, None], corners[:, ::-1], corners)
    is_outer = np.minimum(before, behind) < INNER
    used, numbers = np.unique(turned[is_outer] if is_outer.any() else turned, return_inverse=True)
    return places[used], numbers.reshape(-1, 3)


def _divided(vertices: FloatArray, triangles: Ints, longest: float) -> tuple[FloatArray, Ints]:
    """The same surface with no edge over `longest` [m]."""
    from trimesh.remesh import subdivide_to_size  # half a second that a game need not wait for

    x = vertices[triangles]
    most = float(np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2).max())
    if most > longest:
        rounds = int(np.ceil(np.log2(most / longest))) + 2
        vertices, triangles = subdivide_to_size(vertices, triangles, longest, max_iter=rounds)
        vertices, numbers = np.unique(vertices, axis=0, return_inverse=True)
        triangles = numbers.reshape(-1)[triangles]
    return np.asarray(vertices, dtype=np.float64), np.asarray(triangles, dtype=np.int64)


def _normals(vertices: FloatArray, triangles: Ints) -> FloatArray:
    """Means of those of the triangles round each vertex, by area, (n, 3); 0 where there are none."""
    x = vertices[triangles]
    areas = np.repeat(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), 3, axis=0)
    sums = [np.bincount(triangles.ravel(), areas[:, k], len(vertices)) for k in range(3)]
    normals = np.stack(sums, axis=1)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(lengths > 0, normals / np.where(lengths > 0, lengths, 1.0), 0.0)


def _patches(vertices: FloatArray, normals: FloatArray, cell: float) -> Ints:
    """A number of the patch of each vertex: its cell, and which of six ways it faces."""
    places = np.floor((vertices - vertices.min(axis=0)) / cell).astype(np.int64)
    axis = np.abs(normals).argmax(axis=1)
    way = 2 * axis + (normals[np.arange(len(normals)), axis] < 0.0)
    size = places.max(axis=0) + 1
    return np.asarray(np.ravel_multi_index((*places.T, way), (*size, 6)), dtype=np.int64)


def _tips(vertices: FloatArray, count: int) -> Ints:
    """In how many of so many even directions each vertex is the farthest, (n,)."""
    number = np.arange(count) + 0.5
    height, turn = 1.0 - 2.0 * number / count, np.pi * (1.0 + np.sqrt(5.0)) * number
    radius = np.sqrt(1.0 - height**2)
    directions = np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)
    farthest = [int((vertices @ direction).argmax()) for direction in directions]
    return np.bincount(farthest, minlength=len(vertices))


def _leaders(vertices: FloatArray, normals: FloatArray, tips: Ints, patch: Ints, count: int) -> Ints:
    """The vertex of each patch that is a tip in most directions; or, where none is, the farthest along the
    mean of the normals there."""
    means = np.stack([np.bincount(patch, normals[:, k], count) for k in range(3)], axis=1)
    height = np.einsum("nk,nk->n", vertices, means[patch])
    order = np.lexsort((np.arange(len(patch)), -height, -tips, patch))
    first = np.r_[True, patch[order][1:] != patch[order][:-1]]
    return order[first]


def _between(corners: Ints) -> Ints:
    """Triangles with three different corners, each once."""
    is_flat = (corners == np.roll(corners, 1, axis=1)).any(axis=1)
    corners = corners[~is_flat]
    lead = corners.argmin(axis=1)
    rows = np.arange(len(corners))[:, None]
    return np.unique(corners[rows, (lead[:, None] + np.arange(3)) % 3], axis=0).reshape(-1, 3)


def _without_fins(triangles: Ints) -> Ints:
    """Without pairs of the same corners that face opposite ways: they enclose nothing."""
    corners = np.sort(triangles, axis=1)
    _, number, count = np.unique(corners, axis=0, return_inverse=True, return_counts=True)
    is_single = count[number.reshape(-1)] == 1
    return triangles[is_single] if is_single.any() else triangles
