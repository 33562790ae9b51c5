"""Masses of a cage's vertices that together weigh and turn as the solid does."""

from __future__ import annotations

import numpy as np

from taichi_soft.core.residue import kept
from taichi_soft.meshing.arrays import FloatArray

LEAST = 0.5
"""Of a vertex's share of the mass: lighter ones vibrate fast, and make the stable step shorter."""

ROUNDS = 50

HALVINGS = 12
"""Of a step that leaves more lacking."""

CLOSE = 1e-9
"""Of the mass: what the sums may lack."""


def fitted(
    points: FloatArray, shares: FloatArray, mass: float, first: FloatArray, second: FloatArray
) -> FloatArray:
    """Positive masses (n,) nearest to `shares` (n,) whose sum and moments are those wanted, if there are.

    Without a change, a solid's mass lumped at vertices turns too heavily: a vertex is farther out than what
    it stands for. The sum of squared changes, each over its share, is made as small as it can be.

    Args:
        points: of the vertices, (n, 3) [m].
        mass: wanted sum.
        first: wanted sum of mass times position, (3,).
        second: wanted sum of mass times position times position, (3, 3).
    """
    center = first / mass
    size = float(np.abs(points - center).max())
    r = (points - center) / size
    rows, columns = np.triu_indices(3)
    equations = np.concatenate([np.ones((1, len(r))), r.T, (r[:, rows] * r[:, columns]).T])
    about = second - mass * np.outer(center, center)
    wanted = np.concatenate([[mass], np.zeros(3), about[rows, columns] / size**2])
    shares = shares * (mass / shares.sum())
    least = LEAST * shares
    multipliers, masses = np.zeros(len(equations)), shares
    lacking = wanted - equations @ masses
    for _ in range(ROUNDS):  # Newton's method on the dual problem, whose gradient is what the sums lack
        if np.abs(lacking).max() <= CLOSE * mass:
            break
        weighted = equations * np.where(masses > least, shares, 0.0)
        step = np.linalg.lstsq(weighted @ equations.T, lacking, rcond=1e-10)[0]
        for part in 0.5 ** np.arange(HALVINGS):
            tried = np.maximum(shares * (1.0 + (multipliers + part * step) @ equations), least)
            left = wanted - equations @ tried
            if np.linalg.norm(left) < np.linalg.norm(lacking):
                break
        else:
            break  # there are no such masses: these come near
        multipliers, masses, lacking = multipliers + part * step, tried, left
    return kept(masses * (mass / masses.sum()))
