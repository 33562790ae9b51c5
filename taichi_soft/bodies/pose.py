"""Rigid motion that best fits a deformation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_REGULARISATION = 1e-10
"""Weight of rotating as little as possible. It decides only what the shape leaves open: the rotation of a
straight rope about its axis, and of a body shrunk to a point."""


@dataclass(frozen=True, eq=False)
class Pose:
    """A rotation followed by a translation."""

    rotation: Floats  # (3, 3), determinant +1
    position: Floats  # (3,) [m], position of the origin


def best_fitting_pose(rest: Floats, positions: Floats, masses: Floats) -> Pose:
    """Pose of the rest shape that best fits the positions, by squared distances weighted by mass.

    Kabsch 1976; always a rotation, even for flat and mirrored shapes.
    Args:
        rest, positions: (n, 3) [m].
        masses: (n,) [kg], positive.
    """
    weights = masses / masses.sum()
    rest_center, center = weights @ rest, weights @ positions
    offsets = rest - rest_center
    moment = ((positions - center) * weights[:, None]).T @ offsets
    spread = weights @ (offsets**2).sum(axis=1)
    U, _, Vt = np.linalg.svd(moment + _REGULARISATION * spread * np.eye(3))
    U[:, 2] *= np.sign(np.linalg.det(U @ Vt))
    rotation = U @ Vt
    return Pose(rotation, center - rotation @ rest_center)
