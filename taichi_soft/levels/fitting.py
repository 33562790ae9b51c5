"""The rigid motion that fits some vertices best, with the same bits on every processor.

LAPACK rounds differently on each processor, and round-off decides the turn of vertices on a line. So each sum
is written out here. The native library has the same sums in `fitting.hpp`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.math.rotations import length_of, matrix_of, turned
from taichi_soft.core.residue import weighted_sum

Floats = NDArray[np.float64]

LEANING = 1e-10
"""Weight of turning as little as possible: it decides only what the places leave open."""

SWEEPS = 30
"""Jacobi rotations of all pairs of axes. Pairs with a zero between them are skipped."""


def fitting_motion(rest: Floats, now: Floats) -> tuple[Floats, Floats]:
    """Fit a rotation (3, 3) and the place of the origin, (3,) [m], that put `rest` nearest to `now`.

    Args: rest, now: (n, 3) [m].
    """
    shares = np.full(len(rest), 1.0 / len(rest))
    rest_center, center = weighted_sum(shares, rest), weighted_sum(shares, now)
    arms = rest - rest_center
    moment, spread = moments(shares, now - center, arms), moments(shares, arms, arms)
    moment += LEANING * (spread[0, 0] + spread[1, 1] + spread[2, 2]) * np.eye(3)
    turn = nearest_rotation(moment)
    return turn, center - turned(rest_center[None], turn)[0]


def moments(weights: Floats, a: Floats, b: Floats) -> Floats:
    """Sum of w a b^T, (3, 3), of weights (n,) and rows (n, 3)."""
    return np.asarray((weights[:, None, None] * a[:, :, None] * b[:, None, :]).sum(axis=0))


def nearest_rotation(matrix: Floats) -> Floats:
    """The rotation R with the largest trace of R^T m, (3, 3): Horn 1987. No turn for zeros."""
    m = matrix.tolist()
    square = [
        [m[0][0] - m[1][1] - m[2][2], m[0][1] + m[1][0], m[0][2] + m[2][0], m[2][1] - m[1][2]],
        [m[0][1] + m[1][0], m[1][1] - m[0][0] - m[2][2], m[1][2] + m[2][1], m[0][2] - m[2][0]],
        [m[0][2] + m[2][0], m[1][2] + m[2][1], m[2][2] - m[0][0] - m[1][1], m[1][0] - m[0][1]],
        [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1], m[0][0] + m[1][1] + m[2][2]],
    ]
    vectors = _diagonalized(square)
    best = 3
    for i in range(3):
        if square[i][i] > square[best][best]:
            best = i
    quaternion = np.array([row[best] for row in vectors])
    return matrix_of(quaternion / length_of(quaternion))


def _diagonalized(a: list[list[float]]) -> list[list[float]]:
    """Turn a symmetric matrix until it is diagonal. Returns: the eigenvectors, in columns."""
    size = len(a)
    vectors = [[float(i == k) for k in range(size)] for i in range(size)]
    for _ in range(SWEEPS):
        for p in range(size):
            for q in range(p + 1, size):
                if a[p][q] != 0.0:
                    _turn(a, vectors, p, q)
    return vectors


def _turn(a: list[list[float]], vectors: list[list[float]], p: int, q: int) -> None:
    """Turn two axes of a matrix so that it has a zero between them, but for round-off."""
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
