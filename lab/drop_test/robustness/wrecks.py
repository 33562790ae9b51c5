"""Strong initial deformations, from which a body must recover its shape."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.math.rotations import matrix_of

Floats = NDArray[np.float64]
Wreck = Callable[[Floats, np.random.Generator], Floats]
"""Function that maps the vertices (n, 3) of a body about the origin to deformed positions."""

NOISE = 1e-3
"""Remaining thickness of flattened, straightened or shrunk bodies [sizes of the body]."""


def _scrambled(x: Floats, rng: np.random.Generator) -> Floats:
    return rng.uniform(x.min(), x.max(), x.shape)


def _flattened(x: Floats, rng: np.random.Generator) -> Floats:
    normal = _direction(rng)
    return x - np.outer(x @ normal, normal) + _noise(x, rng)


def _drawn(x: Floats, rng: np.random.Generator) -> Floats:
    along = _direction(rng)
    return np.outer(x @ along, along) + _noise(x, rng)


def _inside_out(x: Floats, rng: np.random.Generator) -> Floats:
    return -x + _noise(x, rng)


def _shrunk(x: Floats, rng: np.random.Generator) -> Floats:
    return NOISE * x + 0.1 * _noise(x, rng)


def _point(x: Floats, rng: np.random.Generator) -> Floats:
    return np.zeros_like(x)


WRECKS: dict[str, Wreck] = {
    "scrambled": _scrambled,
    "flattened": _flattened,
    "drawn into a line": _drawn,
    "inside out": _inside_out,
    "shrunk to 1/1000": _shrunk,
    "shrunk to a point": _point,
}


def wrecked(x: Floats, wreck: str, seed: int) -> Floats:
    """Return the deformed positions (n, 3) [m] of a body whose vertices `x` lie about the origin."""
    return WRECKS[wreck](x, np.random.default_rng([seed, list(WRECKS).index(wreck)]))


def distance_from_rest(rest: Floats, now: Floats, masses: Floats) -> float:
    """Return the distance of a body from its rest shape after the best rigid motion (Kabsch 1976).

    The distance is a root mean square over vertices, weighted by mass. Its unit is the longest edge of the
    rest shape's bounding box.
    """
    weights = masses / masses.sum()
    a, b = rest - weights @ rest, now - weights @ now
    u, _, v = np.linalg.svd((weights[:, None] * a).T @ b)
    turn = (u * (1, 1, np.sign(np.linalg.det(u @ v)))) @ v
    return float(np.sqrt(weights @ ((a @ turn - b) ** 2).sum(axis=1)) / np.ptp(rest, axis=0).max())


def _noise(x: Floats, rng: np.random.Generator) -> Floats:
    return rng.normal(scale=NOISE * np.ptp(x, axis=0).max(), size=x.shape)


def _direction(rng: np.random.Generator) -> Floats:
    quaternion = rng.normal(size=4)
    matrix: Floats = matrix_of(quaternion / np.linalg.norm(quaternion))
    return np.asarray(matrix[0])
