"""Rotations as unit quaternions (x, y, z, w), in float64.

Each sum has an explicit order, so that other languages can compute the same bits. Linear algebra libraries
differ in the rounding of dot products, and C libraries in the rounding of sine and arctangent.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def turning_rows(x: Any, y: Any, z: Any, w: Any) -> list[list[Any]]:
    """Return the rows of the rotation matrix of a unit quaternion. The arguments can be numbers or arrays."""
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]


def length_of(vector: Floats) -> float:
    """Return the length of a vector of three or four numbers."""
    total = 0.0
    for each in vector.tolist():
        total += each * each
    return math.sqrt(total)


def turned(points: Floats, rows: Floats) -> Floats:
    """Return the product of the matrix `rows` (3, 3) and each of the points (n, 3)."""
    x, y, z = points[:, 0], points[:, 1], points[:, 2]
    return np.stack([row[0] * x + row[1] * y + row[2] * z for row in rows], axis=1)


def quaternion_of(matrix: Floats) -> Floats:
    """Convert a rotation matrix (3, 3) to a unit quaternion with non-negative w."""
    # The rows of 4 q q^T are multiples of q. The longest row is the most accurate.
    m = matrix
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    skew = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
    square = np.empty((4, 4))
    square[:3, :3] = m + m.T + (1.0 - trace) * np.eye(3)
    square[3, :3] = square[:3, 3] = skew
    square[3, 3] = 1.0 + trace
    row = square[np.argmax(np.diag(square))]
    quaternion = row / length_of(row)
    return -quaternion if quaternion[3] < 0 else quaternion


def matrix_of(quaternion: Floats) -> Floats:
    """Convert a unit quaternion to a rotation matrix (3, 3)."""
    return np.array(turning_rows(*quaternion.tolist()))


def multiplied(second: Floats, first: Floats) -> Floats:
    """Return the product of two quaternions: the rotation `first`, followed by `second`."""
    (a, b, c, w), (d, e, f, u) = second.tolist(), first.tolist()
    return np.array(
        [
            w * d + u * a + (b * f - c * e),
            w * e + u * b + (c * d - a * f),
            w * f + u * c + (a * e - b * d),
            w * u - (a * d + b * e + c * f),
        ]
    )


def rotation_vector(start: Floats, end: Floats) -> Floats:
    """Return the shortest rotation from the quaternion `start` to `end`, as axis times angle, (3,) [rad]."""
    turn = multiplied(end, np.r_[-start[:3], start[3]])
    if turn[3] < 0:
        turn = -turn
    sine = length_of(turn[:3])
    if sine < 1e-12:
        return np.asarray(2.0 * turn[:3])
    return np.asarray(turn[:3] / sine * (2.0 * _angle(sine, turn[3])))


def turned_by(quaternion: Floats, vector: Floats) -> Floats:
    """Return the unit quaternion of the rotation `quaternion`, followed by a rotation vector [rad]."""
    angle = length_of(vector)
    cosine, sine = _cos_sin(0.5 * angle)
    axis = vector * (0.5 if angle == 0.0 else sine / angle)
    result = multiplied(np.r_[axis, cosine], quaternion)
    return np.asarray(result / length_of(result))


def _cos_sin(angle: float) -> tuple[float, float]:
    """Return the cosine and the sine of an angle [rad].

    The Taylor series is evaluated for an eighth of the angle, and the angle is then doubled three times.
    """
    part = (angle - math.tau * math.floor(angle / math.tau + 0.5)) / 8.0
    square = part * part
    behind = versine = 0.0  # sine = part (1 - behind), cosine = 1 - versine
    for k in range(16, 0, -2):
        behind = (1.0 - behind) * square / (k * (k + 1))
        versine = (1.0 - versine) * square / (k * (k - 1))
    sine = part * (1.0 - behind)
    for _ in range(3):
        sine, versine = 2.0 * sine * (1.0 - versine), 2.0 * sine * sine
    return 1.0 - versine, sine


def _angle(sine: float, cosine: float) -> float:
    """Return the angle that has this sine and this cosine [rad]. The cosine must be 0 or more.

    Gregory's series is evaluated for the tangent of a quarter of the angle.
    """
    tangent = sine / (1.0 + cosine)
    tangent = tangent / (1.0 + math.sqrt(1.0 + tangent * tangent))
    square, behind = tangent * tangent, 0.0
    for k in range(41, 1, -2):
        behind = square * (1.0 / k - behind)
    return 4.0 * tangent * (1.0 - behind)
