"""Areas of plane sections of tetrahedra."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.meshing.arrays import FloatArray


def section_areas(heights: FloatArray, volumes: FloatArray) -> FloatArray:
    """Return the areas of the sections of tetrahedra with the plane at height 0, (m,) [m^2].

    As a function of height, the area of the section is the volume of the tetrahedron times a quadratic
    B-spline (Curry and Schoenberg 1966). The knots of the B-spline are the heights of the corners, and its
    integral is 1. A face in the plane belongs to the tetrahedron above the plane, so that a shared face is
    counted once.
    Args:
        heights: heights of the corners above the plane, (m, 4) [m].
        volumes: (m,) [m^3], 0 or more.
    """
    knots = np.sort(heights, axis=1)
    spline = ((knots[:, :-1] <= 0) & (knots[:, 1:] > 0)).astype(np.float64)
    for degree in (1, 2):
        spans = knots[:, degree:] - knots[:, :-degree]
        rising = _divide(-knots[:, : -degree - 1], spans[:, :-1]) * spline[:, :-1]
        falling = _divide(knots[:, degree + 1 :], spans[:, 1:]) * spline[:, 1:]
        spline = rising + falling
    return np.asarray(3.0 * _divide(volumes, knots[:, 3] - knots[:, 0]) * spline[:, 0])


def _divide(numerator: FloatArray, denominator: FloatArray) -> NDArray[np.float64]:
    """Return numerator / denominator, or 0 if the denominator is 0."""
    return np.divide(numerator, denominator, out=np.zeros_like(numerator), where=denominator > 0)
