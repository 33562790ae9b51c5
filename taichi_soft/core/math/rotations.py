"""Rotations as unit quaternions (x, y, z, w), in NumPy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def quaternion_of(matrix: Floats) -> Floats:
    """The quaternion of a rotation matrix (3, 3), with w of 0 or more."""
    # 4 q q^T, whose rows are all q times one of its components: the longest is the most exact.
    m = matrix
    skew = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
    square = np.empty((4, 4))
    square[:3, :3] = m + m.T + (1.0 - np.trace(m)) * np.eye(3)
    square[3, :3] = square[:3, 3] = skew
    square[3, 3] = 1.0 + np.trace(m)
    row = square[np.argmax(np.diag(square))]
    quaternion = row / np.linalg.norm(row)
    return -quaternion if quaternion[3] < 0 else quaternion


def matrix_of(quaternion: Floats) -> Floats:
    """The rotation matrix (3, 3) of a unit quaternion."""
    axis, w = quaternion[:3], quaternion[3]
    cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return np.asarray(np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross)


def multiplied(second: Floats, first: Floats) -> Floats:
    """The turn `first` and then `second`."""
    a, w = second[:3], second[3]
    b, u = first[:3], first[3]
    return np.r_[w * b + u * a + np.cross(a, b), w * u - a @ b]


def rotation_vector(start: Floats, end: Floats) -> Floats:
    """The shortest turn from one quaternion to another: axis times angle, (3,) [rad]."""
    turn = multiplied(end, np.r_[-start[:3], start[3]])
    if turn[3] < 0:
        turn = -turn
    sine = np.linalg.norm(turn[:3])
    if sine < 1e-12:
        return np.asarray(2.0 * turn[:3])
    return np.asarray(turn[:3] / sine * (2.0 * np.arctan2(sine, turn[3])))


def turned_by(quaternion: Floats, vector: Floats) -> Floats:
    """A quaternion turned further by a rotation vector [rad], of unit length."""
    angle = float(np.linalg.norm(vector))
    axis = vector * (0.5 if angle == 0.0 else np.sin(0.5 * angle) / angle)
    result = multiplied(np.r_[axis, np.cos(0.5 * angle)], quaternion)
    return np.asarray(result / np.linalg.norm(result))
