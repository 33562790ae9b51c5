"""Signed distances from solids: functions that map points (n, 3) in the solid's axes to distances (n,) [m].

These functions check the kernels and therefore share no code with the kernels. All distances are float64.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Distance = Callable[[Floats], Floats]


def half_space(normal: Floats, offset: float = 0.0) -> Distance:
    """Return the distance function of a half space.

    Args:
        normal: unit normal of the bounding plane, pointing out of the half space, (3,).
        offset: distance of the plane from the origin along the normal [m].
    """
    return lambda x: np.asarray(x @ normal - offset)


def ball(radius: float) -> Distance:
    """Return the distance function of a ball centred at the origin."""
    return lambda x: np.asarray(np.linalg.norm(x, axis=1) - radius)


def cuboid(size: Floats) -> Distance:
    """Return the distance function of a cuboid centred at the origin, with edges (3,) along the axes [m]."""

    def distance(x: Floats) -> Floats:
        beyond = np.abs(x) - size / 2
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        return np.asarray(outside + np.minimum(beyond.max(axis=1), 0.0))

    return distance


def capsule(radius: float, length: float) -> Distance:
    """Return the distance function of a capsule around a segment of the z axis, centred at the origin."""

    def distance(x: Floats) -> Floats:
        axis = x - np.outer(np.clip(x[:, 2], -length / 2, length / 2), (0.0, 0.0, 1.0))
        return np.asarray(np.linalg.norm(axis, axis=1) - radius)

    return distance


def ring(major: float, minor: float) -> Distance:
    """Return the distance function of a torus about the z axis."""

    def distance(x: Floats) -> Floats:
        along = np.hypot(x[:, 0], x[:, 1]) - major
        return np.asarray(np.hypot(along, x[:, 2]) - minor)

    return distance


def ground(heights: Floats, spacing: float) -> Distance:
    """Return a function that computes a lower bound of the distance from a height field.

    The bound is the height above the field times the cosine of the field's steepest slope. Each cell consists
    of two triangles that meet on the diagonal from (i, j) to (i + 1, j + 1).
    """
    nx, ny = heights.shape
    along, across = (np.abs(np.diff(heights, axis=axis)).max() / spacing for axis in (0, 1))
    cosine = 1.0 / np.sqrt(1.0 + along**2 + across**2)

    def distance(x: Floats) -> Floats:
        u = np.clip(x[:, 0] / spacing + (nx - 1) / 2, 0.0, nx - 1.0)
        v = np.clip(x[:, 1] / spacing + (ny - 1) / 2, 0.0, ny - 1.0)
        i, j = np.minimum(u.astype(int), nx - 2), np.minimum(v.astype(int), ny - 2)
        s, t = u - i, v - j
        near, far = heights[i, j], heights[i + 1, j + 1]
        side = np.where(s >= t, heights[i + 1, j], heights[i, j + 1])
        rise = np.where(s >= t, s * (side - near) + t * (far - side), s * (far - side) + t * (side - near))
        return np.asarray((x[:, 2] - near - rise) * cosine)

    return distance
