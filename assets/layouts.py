"""Vertices and elements of three bodies: a long rod, a disc, and a plate with a hole."""

from __future__ import annotations

import numpy as np
from scipy.spatial import Delaunay


def ring(count: int, radius: float, phase: float = 0.0) -> np.ndarray:
    """Return `count` evenly spaced points on a circle, (count, 2).

    Args:
        phase: rotation of the points about the centre, in multiples of the angle between two neighbours.
    """
    angle = (np.arange(count) + phase) * (2 * np.pi / count)
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def flat_triangles(points: np.ndarray, least_area: float = 1e-6) -> np.ndarray:
    """Return the Delaunay triangles of points (n, 2) without the flat triangles at straight borders, (t, 3).

    Args:
        least_area: triangles are omitted if twice their area is at most this value.
    """
    triangles = Delaunay(points).simplices.astype(np.int64)
    a, b = (points[triangles[:, i]] - points[triangles[:, 0]] for i in (1, 2))
    return triangles[np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) > least_area]


def disc(rings: list[tuple[int, float, float]]) -> tuple[np.ndarray, np.ndarray]:
    """Make a disc from its centre and rings of (count, radius, phase).

    Returns: points (n, 2), and the triangles between them (t, 3).
    """
    points = np.concatenate([np.zeros((1, 2)), *(ring(*each) for each in rings)])
    return points, flat_triangles(points)


def rod(
    height: float,
    radius: float,
    around: int,
    bands: list[int],
    cap: list[tuple[int, float, float]],
    axis: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Make a cylinder along z with points on its surface and a few points on its axis.

    Each surface triangle forms a tetrahedron with one axis point. Each edge between triangles of different
    axis points forms tetrahedra with the segments of the axis between these points. Therefore no tetrahedron
    lies flat in the surface. A Delaunay triangulation of the same points would have flat tetrahedra there.

    Args:
        around: number of points on each ring of the wall. Neighbouring rings are staggered.
        bands: number of layers of the wall that belong to each axis point.
        cap: rings (count, radius, phase) of points inside each of the two flat ends.
        axis: the axis points are evenly spaced from z = -axis to z = axis.
    Returns: points (n, 3) and tetrahedra (m, 4) of either orientation.
    """
    levels = np.linspace(-height / 2, height / 2, sum(bands) + 1)
    walls = [ring(around, radius, 0.5 * (level % 2)) for level in range(len(levels))]
    inside = np.concatenate([ring(*each) for each in cap])
    wall_count, first_axis = around * len(levels), around * len(levels) + 2 * len(inside)
    points = np.concatenate(
        [np.column_stack([wall, np.full(around, z)]) for wall, z in zip(walls, levels, strict=True)]
        + [np.column_stack([inside, np.full(len(inside), z)]) for z in (levels[0], levels[-1])]
        + [np.column_stack([np.zeros((len(bands), 2)), np.linspace(-axis, axis, len(bands))])]
    )

    here, after = np.arange(around), (np.arange(around) + 1) % around
    triangles, owners = [], []
    for level, owner in enumerate(np.repeat(np.arange(len(bands)), bands)):
        low, high = level * around, (level + 1) * around
        up, down = (high + here, low + after) if level % 2 == 0 else (high + after, low + here)
        triangles += [
            np.column_stack([low + here, low + after, up]),
            np.column_stack([high + here, high + after, down]),
        ]
        owners += [np.full(2 * around, owner)]
    for end, level, owner in ((0, 0, 0), (1, len(levels) - 1, len(bands) - 1)):
        number = np.r_[level * around + here, wall_count + end * len(inside) + np.arange(len(inside))]
        triangles.append(number[flat_triangles(np.concatenate([walls[level], inside]))])
        owners.append(np.full(len(triangles[-1]), owner))
    surface, owner = np.concatenate(triangles), np.concatenate(owners)

    tets = [np.column_stack([surface, first_axis + owner])]
    sides = np.sort(surface[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    order = np.lexsort(sides.T)
    pairs, owners_of_pair = sides[order][::2], np.sort(np.repeat(owner, 3)[order].reshape(-1, 2), axis=1)
    for step in range(len(bands) - 1):
        crossing = pairs[(owners_of_pair[:, 0] <= step) & (owners_of_pair[:, 1] > step)]
        tets.append(np.insert(crossing, 2, [[first_axis + step], [first_axis + step + 1]], axis=1))
    return points, np.concatenate(tets)


def plate_with_hole(
    length: float, width: float, hole: float, spacing: float, smoothing: int = 60
) -> tuple[np.ndarray, np.ndarray]:
    """Make a rectangle about the origin with a round hole in its centre, with triangles of similar size.

    Args:
        hole: radius of the hole.
        spacing: distance between neighbouring points.
        smoothing: number of rounds in which each inner point moves to the mean of its neighbours.
    Returns: points (n, 2) and triangles (t, 3).
    """

    def side(count: int) -> np.ndarray:
        return np.linspace(-0.5, 0.5, count + 1)[:-1]

    along, across = side(round(length / spacing)), side(round(width / spacing))
    border = np.concatenate(
        [
            np.column_stack([along * length, np.full(len(along), -width / 2)]),
            np.column_stack([np.full(len(across), length / 2), across * width]),
            np.column_stack([-along * length, np.full(len(along), width / 2)]),
            np.column_stack([np.full(len(across), -length / 2), -across * width]),
            ring(round(2 * np.pi * hole / spacing), hole),
        ]
    )
    rows = int(width / spacing) + 2
    grid = np.indices((int(length / spacing) + 2, 2 * rows)).reshape(2, -1).T - [length / spacing / 2, rows]
    grid = (grid + np.column_stack([grid[:, 1] % 2 / 2, np.zeros(len(grid))])) * spacing * [1, np.sqrt(0.75)]
    room = np.minimum(length / 2 - abs(grid[:, 0]), width / 2 - abs(grid[:, 1]))
    room = np.minimum(room, np.hypot(*grid.T) - hole)
    points = np.concatenate([border, grid[room > 0.6 * spacing]])
    for _ in range(smoothing):
        triangles = _outside_hole(points, flat_triangles(points), hole)
        ends = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        total, uses = np.zeros_like(points), np.bincount(ends.ravel(), minlength=len(points))
        np.add.at(total, ends, points[ends[:, ::-1]])
        points[len(border) :] = (total / uses[:, None])[len(border) :]
    return points, _outside_hole(points, flat_triangles(points), hole)


def _outside_hole(points: np.ndarray, triangles: np.ndarray, hole: float) -> np.ndarray:
    return triangles[np.hypot(*points[triangles].mean(axis=1).T) > hole]
