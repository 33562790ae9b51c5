"""Best-fitting rigid motion between two sets of vertices, with the same bits on every processor.

LAPACK rounds differently on each processor, and for vertices on one line round-off decides the rotation.
Therefore each sum is written out here. The native library has the same sums in `fitting.hpp`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.math.rotations import length_of, matrix_of, turned
from taichi_soft.core.residue import weighted_sum

Floats = NDArray[np.float64]

REGULARISATION = 1e-10
"""Weight of the smallest rotation. It decides only rotations that the vertices leave undetermined."""

SWEEPS = 30
"""Jacobi sweeps over all pairs of axes. Pairs whose off-diagonal entry is zero are skipped."""


def fitting_motion(rest: Floats, now: Floats) -> tuple[Floats, Floats]:
    """Fit the rotation (3, 3) and the translation (3,) [m] that map `rest` closest to `now`.

    Args: rest, now: (n, 3) [m].
    """
    weights = np.full(len(rest), 1.0 / len(rest))
    rest_center, center = weighted_sum(weights, rest), weighted_sum(weights, now)
    offsets = rest - rest_center
    covariance, spread = moments(weights, now - center, offsets), moments(weights, offsets, offsets)
    covariance += REGULARISATION * (spread[0, 0] + spread[1, 1] + spread[2, 2]) * np.eye(3)
    rotation = nearest_rotation(covariance)
    return rotation, center - turned(rest_center[None], rotation)[0]


def moments(weights: Floats, a: Floats, b: Floats) -> Floats:
    """Sum of w a b^T, (3, 3), for weights (n,) and rows (n, 3)."""
    return np.asarray((weights[:, None, None] * a[:, :, None] * b[:, None, :]).sum(axis=0))


def nearest_rotation(matrix: Floats) -> Floats:
    """Rotation R with the largest trace of R^T m, (3, 3), by Horn 1987. The identity for zeros."""
    m = matrix.tolist()
    horn_matrix = [
        [m[0][0] - m[1][1] - m[2][2], m[0][1] + m[1][0], m[0][2] + m[2][0], m[2][1] - m[1][2]],
        [m[0][1] + m[1][0], m[1][1] - m[0][0] - m[2][2], m[1][2] + m[2][1], m[0][2] - m[2][0]],
        [m[0][2] + m[2][0], m[1][2] + m[2][1], m[2][2] - m[0][0] - m[1][1], m[1][0] - m[0][1]],
        [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1], m[0][0] + m[1][1] + m[2][2]],
    ]
    vectors = _eigenvectors(horn_matrix)
    best = 3
    for i in range(3):
        if horn_matrix[i][i] > horn_matrix[best][best]:
            best = i
    quaternion = np.array([row[best] for row in vectors])
    return matrix_of(quaternion / length_of(quaternion))


def _eigenvectors(a: list[list[float]]) -> list[list[float]]:
    """Eigenvectors of a symmetric matrix, in columns. Diagonalizes `a` in place by Jacobi rotations."""
    size = len(a)
    vectors = [[float(i == k) for k in range(size)] for i in range(size)]
    for _ in range(SWEEPS):
        for p in range(size):
            for q in range(p + 1, size):
                if a[p][q] != 0.0:
                    _rotate_axes(a, vectors, p, q)
    return vectors


def _rotate_axes(a: list[list[float]], vectors: list[list[float]], p: int, q: int) -> None:
    """Rotate two axes so that their off-diagonal entry becomes zero up to round-off."""
    slope = (a[q][q] - a[p][p]) / (2.0 * a[p][q])
    t = (-1.0 if slope < 0.0 else 1.0) / (abs(slope) + math.sqrt(slope * slope + 1.0))
    c = 1.0 / math.sqrt(t * t + 1.0)
    s = t * c
    for row in a:
        row[p], row[q] = c * row[p] - s * row[q], s * row[p] + c * row[q]
    for k in range(len(a)):
        a[p][k], a[q][k] = c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]
    for row in vectors:
        row[p], row[q] = c * row[p] - s * row[q], s * row[p] + c * row[q]
