"""Several experiments side by side in one world: none knows of the others."""

import numpy as np


def turn(angle, axis):
    """Rodrigues's rotation about a unit axis."""
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def alone(number):
    """The group and mask of experiment `number`, for a body or a collider."""
    return {"group": 1 << number, "mask": 1 << number}
