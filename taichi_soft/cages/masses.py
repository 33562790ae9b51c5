"""Fit the masses of a cage's vertices to the mass and inertia of the solid."""

from __future__ import annotations

import numpy as np

from taichi_soft.core.residue import kept
from taichi_soft.meshing.arrays import FloatArray

MIN_FRACTION = 0.5
"""Smallest mass of a vertex, as a fraction of its lumped mass. Lighter vertices would vibrate fast and
shorten the stable step."""

ROUNDS = 50

HALVINGS = 12
"""Largest number of lengths that are tried for a Newton step. A step that does not reduce the residual is
halved."""

TOLERANCE = 1e-9
"""Largest valid error of the sum and the moments of the masses, as a fraction of the total mass. Moments are
computed with lengths relative to the size of the cage."""


def fitted(
    points: FloatArray, lumped: FloatArray, mass: float, first_moment: FloatArray, second_moment: FloatArray
) -> FloatArray:
    """Return the positive masses closest to `lumped` that have the required sum and moments, (n,).

    Masses lumped at vertices have too much inertia, because a vertex lies farther out than the volume that it
    represents. The solution minimises the sum of squared changes, each divided by the lumped mass. If there
    is no solution, the result satisfies the requirements only approximately.

    Args:
        points: positions of the vertices, (n, 3) [m].
        lumped: lumped masses, (n,).
        mass: required sum.
        first_moment: required sum of mass times position, (3,).
        second_moment: required sum of mass times position times position, (3, 3).
    """
    center = first_moment / mass
    size = float(np.abs(points - center).max())
    r = (points - center) / size
    rows, columns = np.triu_indices(3)
    equations = np.concatenate([np.ones((1, len(r))), r.T, (r[:, rows] * r[:, columns]).T])
    about = second_moment - mass * np.outer(center, center)
    required = np.concatenate([[mass], np.zeros(3), about[rows, columns] / size**2])
    lumped = lumped * (mass / lumped.sum())
    smallest = MIN_FRACTION * lumped
    multipliers, masses = np.zeros(len(equations)), lumped
    residual = required - equations @ masses
    for _ in range(ROUNDS):  # Newton's method on the dual problem; the residual is its gradient
        if np.abs(residual).max() <= TOLERANCE * mass:
            break
        weighted = equations * np.where(masses > smallest, lumped, 0.0)
        step = np.linalg.lstsq(weighted @ equations.T, residual, rcond=1e-10)[0]
        for factor in 0.5 ** np.arange(HALVINGS):
            tried = np.maximum(lumped * (1.0 + (multipliers + factor * step) @ equations), smallest)
            new_residual = required - equations @ tried
            if np.linalg.norm(new_residual) < np.linalg.norm(residual):
                break
        else:
            break  # no masses satisfy all equations: keep the masses of the last step
        multipliers, masses, residual = multipliers + factor * step, tried, new_residual
    return kept(masses * (mass / masses.sum()))
