"""Barycentric coordinates in NumPy. LAPACK is not used, because its rounding depends on the processor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def edge_inverses(corners: Floats) -> Floats:
    """Compute A^-1 of thesis eq. 6.1 by Cramer's rule, (..., 3, 3) [1/m], for corners (..., 4, 3) [m].

    The rows of A^-1 are the gradients of the barycentric coordinates of corners 1 to 3.
    """
    a, b, c = (corners[..., i, :] - corners[..., 0, :] for i in (1, 2, 3))
    normals = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=-2)
    return np.asarray(normals / (a * normals[..., 0, :]).sum(axis=-1)[..., None, None])


def barycentric(points: Floats, corners: Floats) -> Floats:
    """Return the barycentric coordinates (..., 4) of points (..., 3) [m], each in its own tetrahedron."""
    return shares_by(edge_inverses(corners), points - corners[..., 0, :])


def shares_by(inverses: Floats, arms: Floats) -> Floats:
    """Return the barycentric coordinates of points, (..., 4).

    Args:
        inverses: result of `edge_inverses`.
        arms: vectors from the first corners to the points, (..., 3) [m].
    """
    x, y, z = arms[..., 0, None], arms[..., 1, None], arms[..., 2, None]
    rest = inverses[..., 0] * x + inverses[..., 1] * y + inverses[..., 2] * z
    return np.concatenate([1.0 - rest.sum(axis=-1, keepdims=True), rest], axis=-1)
