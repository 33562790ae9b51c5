"""Which part of space a surface encloses, whatever is wrong with its triangles.

Lines are drawn through the surface along the three axes. Along each, the winding number is the sum of the
signed crossings behind: it is exact between any two crossings, so that a sheet thinner than a voxel keeps its
volume. Where a surface is whole, it is a whole number and comes back to 0 at the end of the line.

A line that does not come back to 0 went through a hole, a face turned round or a wall within. There the lines
along the other axes tell. Where none of the three is whole, the mean over both senses of all three does: the
generalised winding number (Jacobson, Kavan and Sorkine-Hornung, 2013) from six directions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.meshing.arrays import FloatArray

Ints = NDArray[np.int64]

OFFSET = np.array([0.4142, 0.3183, 0.3679])
"""Of the first voxel's corner before the surface, in voxels: no line runs along faces that are at round
numbers."""

ONCE = 1.0 + 1e-6
"""Winding number, up to rounding, above which something is inside of more than one part of the surface."""

CHUNK = 1 << 20
"""Triangles times lines that are looked at together."""


@dataclass(frozen=True, eq=False)
class Solid:
    """Part of each voxel that is inside, and the surface within it."""

    origin: FloatArray  # (3,), corner of the first voxel [m]
    spacing: float  # edge of a voxel [m]
    fill: FloatArray  # (nx, ny, nz), 0 to 1
    center: FloatArray  # (nx, ny, nz, 3), of what is inside, in voxels from the corner of each
    surface: FloatArray  # (nx, ny, nz, 3), mean of the crossings in a voxel [m], NaN where there are none
    open_share: float  # of all lines that meet the surface: those that do not come back to 0
    is_simple: bool  # all do, and nowhere is anything twice inside: its triangles tell the volume

    @property
    def volume(self) -> float:
        """[m^3]."""
        return float(self.fill.sum()) * self.spacing**3

    def quadrature(self) -> tuple[FloatArray, FloatArray]:
        """Points that stand for the solid, (k, 3) [m], and the volume of each, (k,) [m^3]."""
        is_full = self.fill > 0.0
        points = self.origin + self.spacing * (np.argwhere(is_full) + self.center[is_full])
        return points, self.fill[is_full] * self.spacing**3


def solid_of(vertices: FloatArray, triangles: Ints, spacing: float) -> Solid:
    """The solid within triangles, by voxels.

    Args:
        vertices: (n, 3) [m].
        triangles: (m, 3).
        spacing: edge of a voxel [m].
    """
    low = vertices[triangles].min(axis=(0, 1))
    origin = low - spacing * (1.0 + OFFSET)
    size = np.ceil((vertices[triangles].max(axis=(0, 1)) - origin) / spacing).astype(np.int64) + 1
    places = (vertices - origin) / spacing
    shape = tuple(int(n) for n in size)
    sums, lines, open_lines = np.zeros((*shape, 3)), 0, 0
    total = int(np.prod(shape))
    rows, deepest = [], 0.0
    for axis in range(3):
        points, signs = _crossings(places, triangles, axis)
        voxel = np.minimum(points.astype(np.int64), size - 1)
        flat = np.ravel_multi_index(tuple(voxel.T), shape)
        behind = points[:, axis] - voxel[:, axis]
        row = _Lines(axis, shape, flat, signs, behind)
        deepest = max(deepest, float(np.abs(row.winding).max()))
        if np.abs(row.winding).max() > ONCE:
            outer = _outer(points, voxel, signs, axis)
            row = _Lines(axis, shape, flat, np.where(row.is_whole.ravel()[flat], outer, signs), behind)
        rows.append(row)
        is_met = row.crossings.any(axis=axis)
        lines += int(is_met.sum())
        open_lines += int((is_met & ~row.is_whole.all(axis=axis)).sum())
        for k in range(3):
            sums[..., k] += np.bincount(flat, points[:, k], total).reshape(shape)
    crossings = rows[0].crossings + rows[1].crossings + rows[2].crossings
    with np.errstate(invalid="ignore"):
        surface = origin + spacing * (sums / crossings[..., None])
    fill, center = _fill(rows)
    is_simple = open_lines == 0 and deepest <= ONCE
    return Solid(origin, spacing, fill, center, surface, open_lines / max(lines, 1), is_simple)


class _Lines:
    """What the lines along one axis tell of each voxel, (nx, ny, nz) each."""

    def __init__(
        self, axis: int, shape: tuple[int, ...], voxel: Ints, sign: FloatArray, behind: FloatArray
    ) -> None:
        """Gather the crossings of voxels.

        Args:
            axis: of the lines.
            shape: numbers of voxels along the axes.
            voxel: of each crossing, (k,).
            sign: 1 into the solid, (k,).
            behind: part of the voxel behind it along the line, (k,).
        """

        def gathered(values: FloatArray) -> FloatArray:
            sums: FloatArray = np.bincount(voxel, values, int(np.prod(shape))).astype(np.float64)
            return sums.reshape(shape)

        signs, beyond = gathered(sign), gathered(sign * (1.0 - behind))
        moments = gathered(0.5 * sign * (1.0 - behind**2))
        before = np.cumsum(signs, axis=axis) - signs
        ends = signs.sum(axis=axis, keepdims=True)
        self.crossings = gathered(np.ones(len(sign)))
        self.is_whole = np.broadcast_to(np.abs(ends) < 0.5, signs.shape)
        self.winding = before + beyond - 0.5 * ends  # the mean of coming from one side and from the other
        with np.errstate(invalid="ignore", divide="ignore"):
            center = (0.5 * before + moments) / (before + beyond)
        self.center = np.clip(np.nan_to_num(center, nan=0.5), 0.0, 1.0)


def _outer(points: FloatArray, voxel: Ints, signs: FloatArray, axis: int) -> FloatArray:
    """Signs (k,) of the crossings at which a line enters or leaves the solid, and 0 of those within it.

    So what is inside of several parts of the surface counts once.
    """
    across = [(axis + 1) % 3, (axis + 2) % 3]
    order = np.lexsort((points[:, axis], voxel[:, across[0]], voxel[:, across[1]]))
    line = voxel[order][:, across]
    is_first = np.r_[True, (line[1:] != line[:-1]).any(axis=1)]
    sums = np.cumsum(signs[order])
    before = sums - signs[order]
    depth = sums - before[is_first][np.cumsum(is_first) - 1]
    is_in, was_in = np.abs(depth) > 0.5, np.abs(depth - signs[order]) > 0.5
    found = np.empty(len(signs))
    found[order] = is_in.astype(np.float64) - was_in
    return found


def _fill(rows: list[_Lines]) -> tuple[FloatArray, FloatArray]:
    """Part of each voxel that is inside, from its three lines, and the centre of that part.

    Where lines are whole, those along the axis tell that the surface lies most squarely to: they meet it most
    often hereabouts. (Taken from one voxel alone, the choice would fall on lines that happen to be inside.)
    """
    is_whole = np.stack([row.is_whole for row in rows])
    crossings = np.stack([row.crossings for row in rows])
    windings = np.stack([row.winding for row in rows])
    best = np.argmax(np.where(is_whole, 1.0 + _around(crossings), 0.0), axis=0)
    votes = np.where(is_whole | ~is_whole.any(axis=0), 1.0, 0.0)
    by_vote = np.abs((votes * windings).sum(axis=0)) / votes.sum(axis=0)
    is_crossed = (is_whole & (crossings > 0)).any(axis=0)
    by_best = np.minimum(np.abs(np.take_along_axis(windings, best[None], axis=0)[0]), 1.0)
    center = np.full((*best.shape, 3), 0.5)
    for axis, row in enumerate(rows):
        mine = is_crossed & (best == axis)
        center[mine, axis] = row.center[mine]
    return np.where(is_crossed, by_best, by_vote > 0.5).astype(np.float64), center


def _around(counts: FloatArray) -> FloatArray:
    """Sums over a voxel and its neighbours, of each of the first axis."""
    for axis in (1, 2, 3):
        sums = np.cumsum(np.pad(counts, [(2, 1) if k == axis else (0, 0) for k in range(4)]), axis=axis)
        size = counts.shape[axis]
        counts = np.take(sums, range(3, size + 3), axis=axis) - np.take(sums, range(size), axis=axis)
    return counts


def _crossings(places: FloatArray, triangles: Ints, axis: int) -> tuple[FloatArray, FloatArray]:
    """Where lines along an axis, through the middles of voxels, cross triangles, (k, 3) in voxels, and in
    which sense, (k,): 1 into the solid.

    A line through an edge crosses just one of its two triangles.
    """
    u, v = (axis + 1) % 3, (axis + 2) % 3
    corners = places[triangles]
    first = np.ceil(corners.min(axis=1)[:, [u, v]] - 0.5).astype(np.int64)
    beyond = np.ceil(corners.max(axis=1)[:, [u, v]] - 0.5).astype(np.int64)
    counts = np.prod(np.maximum(beyond - first, 0), axis=1)
    rows = np.flatnonzero(counts)
    ends = np.cumsum(counts[rows])
    points, signs = [np.zeros((0, 3))], [np.zeros(0)]
    start = 0
    while start < len(rows):
        done = ends[start - 1] if start else 0
        stop = max(start + 1, int(np.searchsorted(ends, done + CHUNK, side="right")))
        few = rows[start:stop]
        triangle = np.repeat(few, counts[few])
        number = np.arange(len(triangle)) - np.repeat(ends[start:stop] - counts[few] - done, counts[few])
        width = (beyond - first)[triangle, 1]
        line = np.stack([first[triangle, 0] + number // width, first[triangle, 1] + number % width], axis=1)
        shares = _shares(corners[triangle][:, :, [u, v]], triangles[triangle], line + 0.5)
        area = shares.sum(axis=1)
        hit = area != 0.0
        point = np.empty((int(hit.sum()), 3))
        point[:, [u, v]] = line[hit] + 0.5
        point[:, axis] = np.einsum("ij,ij->i", shares[hit], corners[triangle[hit], :, axis]) / area[hit]
        points.append(point)
        signs.append(-np.sign(area[hit]))
        start = stop
    return np.concatenate(points), np.concatenate(signs)


def _shares(corners: FloatArray, numbers: Ints, line: FloatArray) -> FloatArray:
    """Areas between a line and the edges opposite each corner, (k, 3), all 0 where it misses the triangle.

    Each edge is looked at from its vertex of lower number, so that both its triangles get the same area.
    """
    shares = np.empty((len(line), 3))
    inside = np.ones((len(line), 2), dtype=np.bool_)
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        turn = numbers[:, a] > numbers[:, b]
        low = np.where(turn[:, None], corners[:, b], corners[:, a])
        high = np.where(turn[:, None], corners[:, a], corners[:, b])
        edge, way = high - low, line - low
        area = edge[:, 0] * way[:, 1] - edge[:, 1] * way[:, 0]
        is_left = area >= 0.0  # of the edge, seen from its lower vertex: on it counts as left
        shares[:, k] = np.where(turn, -area, area)
        inside[:, 0] &= is_left != turn
        inside[:, 1] &= is_left == turn
    shares[~inside.any(axis=1)] = 0.0
    return shares
