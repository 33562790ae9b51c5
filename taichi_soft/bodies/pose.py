"""Rigid motion that best fits a deformation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_REGULARISATION = 1e-10
"""Weight with which small rotations are preferred. It has an effect only if the shape does not determine
the rotation, for example about the axis of a straight rope, or for a body shrunk to a point."""


@dataclass(frozen=True, eq=False)
class Pose:
    """A rotation followed by a translation."""

    rotation: Floats  # (3, 3), determinant +1
    position: Floats  # (3,) [m], new position of the rest shape's origin


def best_fitting_pose(rest: Floats, positions: Floats, masses: Floats) -> Pose:
    """Find the pose of the rest shape that minimises the squared distances to `positions`, weighted by mass.

    The method is Kabsch's (1976). The result is never a reflection, even for flat and mirrored shapes.
    Args:
        rest, positions: rest and current positions of the vertices, (n, 3) [m].
        masses: masses of the vertices, (n,) [kg], positive.
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
