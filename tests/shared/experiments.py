"""Several experiments side by side in one world, without interaction."""

import numpy as np


def turn(angle, axis):
    """Return the matrix of a rotation about a unit axis by Rodrigues's formula."""
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def alone(number):
    """Return the collision group and mask of experiment `number`, for a body or a collider."""
    return {"group": 1 << number, "mask": 1 << number}
