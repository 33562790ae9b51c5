"""Compare patches of a surface with their replacements, by distance and by rotation of the normals."""

from __future__ import annotations

import numpy as np

from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.cavities import OUTSIDE, Ints, ranges
from taichi_soft.meshing.topology import LOCAL_FACES

# Points of a triangle at which distances are computed, in barycentric coordinates. Neighbouring points are a
# quarter of a side apart.
_SAMPLES = np.array([(i, j, 4 - i - j) for i in range(5) for j in range(5 - i)]) / 4.0
_SAMPLING_FACTOR = 4 / 3
"""The largest distance between two patches is at most this factor times the largest distance at a sample. The
distance is largest at a corner or at a point where two sides cross. From there, the distance falls at most
linearly towards the end of the side. The nearest sample is at most an eighth of the side away, so the
distance at this sample is at least three quarters of the largest distance."""
_TINY = 1e-300  # [m^2], avoids division by zero for degenerate triangles


def outer_faces(tets: Ints, of: Ints) -> tuple[Ints, Ints]:
    """Find the surface triangles of tetrahedra.

    Args: of: group of each tetrahedron.
    Returns: triangles, wound outwards, (f, 3), and the group of each triangle, (f,).
    """
    row, corner = np.nonzero(tets == OUTSIDE)
    return tets[row[:, None], LOCAL_FACES[corner][:, ::-1]], of[row]


def pairs(first_of: Ints, second_of: Ints, count: int) -> tuple[Ints, Ints]:
    """Return the indices of all pairs of a first and a second entry in the same group, (p,) each.

    Args:
        first_of: group of each first entry.
        second_of: group of each second entry, ascending.
        count: number of groups.
    """
    starts = np.searchsorted(second_of, first_of)
    counts = np.bincount(second_of, minlength=count)[first_of]
    return np.repeat(np.arange(len(first_of)), counts), ranges(starts, counts)


def area_vectors(p: FloatArray) -> FloatArray:
    """Return the normal vectors of triangles, (k, 3). The length of a vector is twice the area [m^2].

    Args: p: corners of the triangles, (k, 3, 3) [m].
    """
    return np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])


def largest_turn(old: FloatArray, old_of: Ints, new: FloatArray, new_of: Ints, count: int) -> FloatArray:
    """Return the cosine of the largest angle between a new triangle and the most similar old triangle.

    Args:
        old, new: corners of the triangles, (k, 3, 3).
        old_of, new_of: group of each triangle, (k,), ascending.
        count: number of groups.
    Returns: cosine for each group, (count,).
    """
    normals = [area_vectors(side) for side in (new, old)]
    first, second = (n / np.maximum(np.linalg.norm(n, axis=1), _TINY)[:, None] for n in normals)
    i, j = pairs(new_of, old_of, count)
    alike = np.full(len(new), -1.0)
    np.maximum.at(alike, i, np.einsum("ij,ij->i", first[i], second[j]))
    turn = np.ones(count)
    np.minimum.at(turn, new_of, alike)
    return turn


def distance(old: FloatArray, old_of: Ints, new: FloatArray, new_of: Ints, count: int) -> FloatArray:
    """Return an upper bound of the distance between the old and the new patch of each group, (count,) [m]."""
    largest = np.zeros(count)
    for here, here_of, there, there_of in ((old, old_of, new, new_of), (new, new_of, old, old_of)):
        points = np.einsum("sc,tcd->tsd", _SAMPLES, here).reshape(-1, 3)
        points_of = here_of.repeat(len(_SAMPLES))
        i, j = pairs(points_of, there_of, count)
        nearest2 = np.full(len(points), np.inf)
        np.minimum.at(nearest2, i, _squared_distances(points[i], there[j]))
        np.maximum.at(largest, points_of, np.sqrt(nearest2))
    return _SAMPLING_FACTOR * largest


def _squared_distances(points: FloatArray, triangles: FloatArray) -> FloatArray:
    """Return the squared distances from points (k, 3) to triangles (k, 3, 3), (k,) [m^2]."""
    normal = area_vectors(triangles)
    length2 = np.einsum("ij,ij->i", normal, normal)
    inside = length2 > _TINY
    nearest = np.full(len(points), np.inf)
    for i in range(3):
        side, offset = triangles[:, (i + 1) % 3] - triangles[:, i], points - triangles[:, i]
        inside &= np.einsum("ij,ij->i", np.cross(side, offset), normal) >= 0
        fraction = np.einsum("ij,ij->i", offset, side) / np.maximum(np.einsum("ij,ij->i", side, side), _TINY)
        rest = offset - np.clip(fraction, 0.0, 1.0)[:, None] * side
        nearest = np.minimum(nearest, np.einsum("ij,ij->i", rest, rest))
    height = np.einsum("ij,ij->i", points - triangles[:, 0], normal)
    return np.where(inside, height**2 / np.maximum(length2, _TINY), nearest)
