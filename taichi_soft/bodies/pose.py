"""The rigid motion that comes nearest to a deformation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_LEANING = 1e-10
"""Weight of turning as little as possible: it decides only what the shape leaves open, as a straight rope
does about its axis, and a body shrunk to a point altogether."""


@dataclass(frozen=True, eq=False)
class Pose:
    """A rotation and then a translation."""

    rotation: Floats  # (3, 3), determinant +1
    position: Floats  # (3,) [m], of the origin


def best_fitting_pose(rest: Floats, positions: Floats, masses: Floats) -> Pose:
    """The pose that puts the rest shape nearest to the positions, in squares of distances weighted by mass.

    Kabsch 1976; always a rotation, also of flat and mirrored shapes.
    Args:
        rest, positions: (n, 3) [m].
        masses: (n,) [kg], positive.
    """
    shares = masses / masses.sum()
    rest_center, center = shares @ rest, shares @ positions
    arms = rest - rest_center
    moment = ((positions - center) * shares[:, None]).T @ arms
    spread = shares @ (arms**2).sum(axis=1)
    U, _, Vt = np.linalg.svd(moment + _LEANING * spread * np.eye(3))
    U[:, 2] *= np.sign(np.linalg.det(U @ Vt))
    rotation = U @ Vt
    return Pose(rotation, center - rotation @ rest_center)
