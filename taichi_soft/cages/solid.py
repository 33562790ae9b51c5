"""Find the part of space that a surface encloses, even if its triangles have defects.

Rays run through the surface along the three axes. The winding number at a point of a ray is the sum of the
signed crossings before the point. This number is exact between any two crossings, so a sheet thinner than a
voxel keeps its volume. If the surface is closed, the winding number is an integer and returns to 0 at the end
of the ray.

If the winding number does not return to 0, the ray crossed a hole, a flipped face or an inner wall. In the
voxels of such a ray, the rays along the other axes decide. If all three rays through a voxel are of this
kind, the mean of their six winding numbers decides, counted from both ends of each ray. This mean is the
generalised winding number (Jacobson, Kavan and Sorkine-Hornung, 2013) from six directions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.meshing.arrays import FloatArray

Ints = NDArray[np.int64]

OFFSET = np.array([0.4142, 0.3183, 0.3679])
"""Offset of the voxel grid relative to the bounding box of the surface, in voxels. The uneven values
prevent rays along faces at round coordinates."""

OVERLAP = 1.0 + 1e-6
"""Winding number above which parts of the surface overlap. The small excess over 1 allows for rounding."""

CHUNK = 1 << 20
"""Number of pairs of a triangle and a ray that are processed at once."""


@dataclass(frozen=True, eq=False)
class Solid:
    """Solid in voxels: the fraction of each voxel that is inside, and the surface within the voxel."""

    origin: FloatArray  # (3,), corner of the first voxel [m]
    spacing: float  # edge of a voxel [m]
    fill: FloatArray  # (nx, ny, nz), fraction of each voxel that is inside, 0 to 1
    center: FloatArray  # (nx, ny, nz, 3), centroid of the inner part, in voxels from the voxel's corner
    surface: FloatArray  # (nx, ny, nz, 3), mean ray crossing in each voxel [m]; NaN without crossings
    open_fraction: float  # fraction of the rays through the surface whose final winding number is not 0
    is_simple: bool  # True if all rays end with winding number 0 and no parts of the surface overlap

    @property
    def volume(self) -> float:
        """Volume of the solid [m^3]."""
        return float(self.fill.sum()) * self.spacing**3

    def quadrature(self) -> tuple[FloatArray, FloatArray]:
        """Return points that represent the solid, (k, 3) [m], and the volume of each point, (k,) [m^3]."""
        is_full = self.fill > 0.0
        points = self.origin + self.spacing * (np.argwhere(is_full) + self.center[is_full])
        return points, self.fill[is_full] * self.spacing**3


def solid_of(vertices: FloatArray, triangles: Ints, spacing: float) -> Solid:
    """Compute the solid that triangles enclose, as voxels.

    Args:
        vertices: (n, 3) [m].
        triangles: (m, 3).
        spacing: edge of a voxel [m].
    """
    low = vertices[triangles].min(axis=(0, 1))
    origin = low - spacing * (1.0 + OFFSET)
    size = np.ceil((vertices[triangles].max(axis=(0, 1)) - origin) / spacing).astype(np.int64) + 1
    coordinates = (vertices - origin) / spacing
    shape = tuple(int(n) for n in size)
    sums, ray_count, open_count = np.zeros((*shape, 3)), 0, 0
    total = int(np.prod(shape))
    all_rays, deepest = [], 0.0
    for axis in range(3):
        points, signs = _crossings(coordinates, triangles, axis)
        voxel = np.minimum(points.astype(np.int64), size - 1)
        flat = np.ravel_multi_index(tuple(voxel.T), shape)
        behind = points[:, axis] - voxel[:, axis]
        rays = _Rays(axis, shape, flat, signs, behind)
        deepest = max(deepest, float(np.abs(rays.winding).max()))
        if np.abs(rays.winding).max() > OVERLAP:
            outer = _outer(points, voxel, signs, axis)
            rays = _Rays(axis, shape, flat, np.where(rays.is_closed.ravel()[flat], outer, signs), behind)
        all_rays.append(rays)
        is_met = rays.crossings.any(axis=axis)
        ray_count += int(is_met.sum())
        open_count += int((is_met & ~rays.is_closed.all(axis=axis)).sum())
        for k in range(3):
            sums[..., k] += np.bincount(flat, points[:, k], total).reshape(shape)
    crossings = all_rays[0].crossings + all_rays[1].crossings + all_rays[2].crossings
    with np.errstate(invalid="ignore"):
        surface = origin + spacing * (sums / crossings[..., None])
    fill, center = _fill(all_rays)
    is_simple = open_count == 0 and deepest <= OVERLAP
    return Solid(origin, spacing, fill, center, surface, open_count / max(ray_count, 1), is_simple)


class _Rays:
    """Crossings and winding numbers of the rays along one axis, (nx, ny, nz) each."""

    def __init__(
        self, axis: int, shape: tuple[int, ...], voxel: Ints, sign: FloatArray, behind: FloatArray
    ) -> None:
        """Accumulate crossings in voxels.

        Args:
            axis: axis of the rays.
            shape: numbers of voxels along the axes.
            voxel: voxel of each crossing, (k,).
            sign: 1 for a crossing into the solid, -1 for a crossing out of it, (k,).
            behind: fraction of the voxel's length that the ray passed before the crossing, (k,).
        """

        def gathered(values: FloatArray) -> FloatArray:
            sums: FloatArray = np.bincount(voxel, values, int(np.prod(shape))).astype(np.float64)
            return sums.reshape(shape)

        signs, end = gathered(sign), gathered(sign * (1.0 - behind))
        moments = gathered(0.5 * sign * (1.0 - behind**2))
        before = np.cumsum(signs, axis=axis) - signs
        ends = signs.sum(axis=axis, keepdims=True)
        self.crossings = gathered(np.ones(len(sign)))
        self.is_closed = np.broadcast_to(np.abs(ends) < 0.5, signs.shape)
        self.winding = before + end - 0.5 * ends  # mean of both directions
        with np.errstate(invalid="ignore", divide="ignore"):
            center = (0.5 * before + moments) / (before + end)
        self.center = np.clip(np.nan_to_num(center, nan=0.5), 0.0, 1.0)


def _outer(points: FloatArray, voxel: Ints, signs: FloatArray, axis: int) -> FloatArray:
    """Return the sign of each crossing, (k,): 1 into the solid, -1 out of it, 0 inside it.

    Overlapping parts of the surface therefore count once.
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


def _fill(rows: list[_Rays]) -> tuple[FloatArray, FloatArray]:
    """Compute the part of each voxel that is inside, from the three rays through the voxel.

    Among rays whose winding number returns to 0, the ray most perpendicular to the surface decides. This ray
    has the most crossings in the voxel and its neighbours. (The crossings in the voxel alone would favour
    rays that happen to be inside.)
    Returns: fraction of the voxel, (nx, ny, nz), and centroid of the part, (nx, ny, nz, 3), in voxels from
        the voxel's corner.
    """
    is_closed = np.stack([row.is_closed for row in rows])
    crossings = np.stack([row.crossings for row in rows])
    windings = np.stack([row.winding for row in rows])
    best = np.argmax(np.where(is_closed, 1.0 + _around(crossings), 0.0), axis=0)
    votes = np.where(is_closed | ~is_closed.any(axis=0), 1.0, 0.0)
    by_vote = np.abs((votes * windings).sum(axis=0)) / votes.sum(axis=0)
    is_crossed = (is_closed & (crossings > 0)).any(axis=0)
    by_best = np.minimum(np.abs(np.take_along_axis(windings, best[None], axis=0)[0]), 1.0)
    center = np.full((*best.shape, 3), 0.5)
    for axis, row in enumerate(rows):
        is_best = is_crossed & (best == axis)
        center[is_best, axis] = row.center[is_best]
    return np.where(is_crossed, by_best, by_vote > 0.5).astype(np.float64), center


def _around(counts: FloatArray) -> FloatArray:
    """Sum `counts` over each voxel and its 26 neighbours, separately for each entry of the first axis."""
    for axis in (1, 2, 3):
        sums = np.cumsum(np.pad(counts, [(2, 1) if k == axis else (0, 0) for k in range(4)]), axis=axis)
        size = counts.shape[axis]
        counts = np.take(sums, range(3, size + 3), axis=axis) - np.take(sums, range(size), axis=axis)
    return counts


def _crossings(coordinates: FloatArray, triangles: Ints, axis: int) -> tuple[FloatArray, FloatArray]:
    """Find the crossings of triangles with the rays that run along an axis through the centres of voxels.

    A ray through an edge crosses exactly one of the edge's two triangles.
    Returns: points (k, 3), in voxels, and signs (k,), 1 for a crossing into the solid and -1 out of it.
    """
    u, v = (axis + 1) % 3, (axis + 2) % 3
    corners = coordinates[triangles]
    first = np.ceil(corners.min(axis=1)[:, [u, v]] - 0.5).astype(np.int64)
    end = np.ceil(corners.max(axis=1)[:, [u, v]] - 0.5).astype(np.int64)
    counts = np.prod(np.maximum(end - first, 0), axis=1)
    rows = np.flatnonzero(counts)
    ends = np.cumsum(counts[rows])
    points, signs = [np.zeros((0, 3))], [np.zeros(0)]
    start = 0
    while start < len(rows):
        done = ends[start - 1] if start else 0
        stop = max(start + 1, int(np.searchsorted(ends, done + CHUNK, side="right")))
        batch = rows[start:stop]
        triangle = np.repeat(batch, counts[batch])
        number = np.arange(len(triangle)) - np.repeat(ends[start:stop] - counts[batch] - done, counts[batch])
        width = (end - first)[triangle, 1]
        line = np.stack([first[triangle, 0] + number // width, first[triangle, 1] + number % width], axis=1)
        areas = _signed_areas(corners[triangle][:, :, [u, v]], triangles[triangle], line + 0.5)
        area = areas.sum(axis=1)
        hit = area != 0.0
        point = np.empty((int(hit.sum()), 3))
        point[:, [u, v]] = line[hit] + 0.5
        point[:, axis] = np.einsum("ij,ij->i", areas[hit], corners[triangle[hit], :, axis]) / area[hit]
        points.append(point)
        signs.append(-np.sign(area[hit]))
        start = stop
    return np.concatenate(points), np.concatenate(signs)


def _signed_areas(corners: FloatArray, numbers: Ints, line: FloatArray) -> FloatArray:
    """Return twice the signed area of the triangle between a ray and the edge opposite each corner, (k, 3).

    The areas are 0 if the ray misses the triangle. Each edge starts at its vertex of lower number, so that
    both triangles at the edge get exactly the same area.
    """
    areas = np.empty((len(line), 3))
    inside = np.ones((len(line), 2), dtype=np.bool_)
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        is_reversed = numbers[:, a] > numbers[:, b]
        low = np.where(is_reversed[:, None], corners[:, b], corners[:, a])
        high = np.where(is_reversed[:, None], corners[:, a], corners[:, b])
        edge, offset = high - low, line - low
        area = edge[:, 0] * offset[:, 1] - edge[:, 1] * offset[:, 0]
        is_left = area >= 0.0  # True if the ray is left of the edge, seen from the edge's start, or on it
        areas[:, k] = np.where(is_reversed, -area, area)
        inside[:, 0] &= is_left != is_reversed
        inside[:, 1] &= is_left == is_reversed
    areas[~inside.any(axis=1)] = 0.0
    return areas
