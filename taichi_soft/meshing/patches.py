"""Patches of a surface against those that take their place: how far apart they lie and how much they turn."""

from __future__ import annotations

import numpy as np

from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.cavities import OUTSIDE, Ints, ranges
from taichi_soft.meshing.topology import LOCAL_FACES

# Points of a triangle at which distances are taken: on the sides a quarter of their length apart.
_SAMPLES = np.array([(i, j, 4 - i - j) for i in range(5) for j in range(5 - i)]) / 4.0
_BETWEEN = 4 / 3
"""The distance is largest at a corner or where two sides cross, and falls from there at most linearly to the
end of a side: the nearest point, an eighth of the side away or less, has three quarters of it."""
_TINY = 1e-300  # [m^2], so that what is a point divides nothing by zero


def outer_faces(tets: Ints, of: Ints) -> tuple[Ints, Ints]:
    """Triangles of the surface (f, 3), wound outwards, among tetrahedra, and their entries of `of`."""
    row, corner = np.nonzero(tets == OUTSIDE)
    return tets[row[:, None], LOCAL_FACES[corner][:, ::-1]], of[row]


def pairs(first_of: Ints, second_of: Ints, count: int) -> tuple[Ints, Ints]:
    """All pairs of entries that belong to the same of `count` groups; `second_of` is sorted."""
    starts = np.searchsorted(second_of, first_of)
    counts = np.bincount(second_of, minlength=count)[first_of]
    return np.repeat(np.arange(len(first_of)), counts), ranges(starts, counts)


def area_vectors(p: FloatArray) -> FloatArray:
    """Twice the area along the normal, of triangles (k, 3, 3), (k, 3) [m^2]."""
    return np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])


def largest_turn(old: FloatArray, old_of: Ints, new: FloatArray, new_of: Ints, count: int) -> FloatArray:
    """Cosine between the new triangle that turns most and the old one most like it, (count,)."""
    normals = [area_vectors(side) for side in (new, old)]
    first, second = (n / np.maximum(np.linalg.norm(n, axis=1), _TINY)[:, None] for n in normals)
    i, j = pairs(new_of, old_of, count)
    alike = np.full(len(new), -1.0)
    np.maximum.at(alike, i, np.einsum("ij,ij->i", first[i], second[j]))
    turn = np.ones(count)
    np.minimum.at(turn, new_of, alike)
    return turn


def distance(old: FloatArray, old_of: Ints, new: FloatArray, new_of: Ints, count: int) -> FloatArray:
    """Largest distance of either patch from the other, (count,) [m], or more."""
    apart = np.zeros(count)
    for here, here_of, there, there_of in ((old, old_of, new, new_of), (new, new_of, old, old_of)):
        points = np.einsum("sc,tcd->tsd", _SAMPLES, here).reshape(-1, 3)
        points_of = here_of.repeat(len(_SAMPLES))
        i, j = pairs(points_of, there_of, count)
        near = np.full(len(points), np.inf)
        np.minimum.at(near, i, _squared_distances(points[i], there[j]))
        np.maximum.at(apart, points_of, np.sqrt(near))
    return _BETWEEN * apart


def _squared_distances(points: FloatArray, triangles: FloatArray) -> FloatArray:
    """From points (k, 3) to triangles (k, 3, 3) [m^2]."""
    normal = area_vectors(triangles)
    length2 = np.einsum("ij,ij->i", normal, normal)
    inside = length2 > _TINY
    nearest = np.full(len(points), np.inf)
    for i in range(3):
        side, arm = triangles[:, (i + 1) % 3] - triangles[:, i], points - triangles[:, i]
        inside &= np.einsum("ij,ij->i", np.cross(side, arm), normal) >= 0
        part = np.einsum("ij,ij->i", arm, side) / np.maximum(np.einsum("ij,ij->i", side, side), _TINY)
        rest = arm - np.clip(part, 0.0, 1.0)[:, None] * side
        nearest = np.minimum(nearest, np.einsum("ij,ij->i", rest, rest))
    height = np.einsum("ij,ij->i", points - triangles[:, 0], normal)
    return np.where(inside, height**2 / np.maximum(length2, _TINY), nearest)
