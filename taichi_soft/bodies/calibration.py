"""Calibrate the material of a coarser mesh to the mass and frequencies of a finer mesh.

A coarse mesh of linear tetrahedra is too stiff, in some modes more than in others. The Young's modulus of
each tetrahedron is therefore updated by the sensitivities of the modes (Friswell and Mottershead 1995). The
sensitivity of a mode is the derivative of its squared frequency with respect to the logarithm of a
tetrahedron's modulus. For a mode u with u^T M u = 1, the sensitivity is the contribution of the tetrahedron
to u^T K u. Many sets of moduli give the target frequencies; the update chooses the set with the smallest
change.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.description import BodyDescription
from taichi_soft.bodies.first_mode import lowest_modes
from taichi_soft.bodies.vibration import TetVibration
from taichi_soft.elements.materials import Material

_log = logging.getLogger(__name__)

Floats = NDArray[np.float64]

MODES = 4
"""Number of slowest modes whose frequencies are calibrated. These modes dominate the visible wobble."""

MODE_TOLERANCE = 2e-3
"""Tolerance of the search for the modes: see `change` of `lowest_modes`."""

TOLERANCE = 0.01
"""Relative error of the frequencies below which the update of the moduli ends."""

WARNING_ERROR = 0.05
"""Relative error of the frequencies above which a warning is logged."""

MAX_UPDATES = 6

RCOND = 0.1
"""Smallest singular value of the sensitivities that is used, as a fraction of the largest singular value.
Smaller singular values belong to modes that no modulus can separate, for example the two bending modes of
a round bar."""

MAX_CHANGE = 3.0
"""Largest factor by which a modulus can differ from the median of all moduli. A larger factor would
visibly change the body."""


def calibrated(fine: BodyDescription, coarser: Sequence[BodyDescription]) -> list[Material]:
    """Return the materials that give coarser bodies the mass and the lowest frequencies of `fine`.

    Args: fine, coarser: bodies of the same material, which has one number for each constant.
    Returns: for each coarser body, a material with a Young's modulus for each tetrahedron.
    """
    target, _ = lowest_modes(fine, MODES, MODE_TOLERANCE)
    return [_fitted(target, fine.masses.sum(), each) for each in coarser]


def _fitted(target: Floats, mass: float, coarse: BodyDescription) -> Material:
    """Return the material that gives `coarse` the angular frequencies `target` [rad/s] and this mass [kg]."""
    material = coarse.material
    assert isinstance(material, Material)
    density = material.density * mass / coarse.masses.sum()
    factors = np.zeros(len(coarse.mesh.tets))  # logarithm of the factor on `young`, for each tetrahedron
    best, smallest_error = coarse.material, np.inf
    for _ in range(MAX_UPDATES):
        young = material.young * np.exp(factors)
        body = replace(coarse, material=replace(material, young=young, density=density))
        found, shapes = lowest_modes(body, MODES, MODE_TOLERANCE)
        count = min(len(target), len(found))
        gaps = 2.0 * np.log(target[:count] / found[:count])
        error = float(np.abs(gaps).max(initial=0.0)) / 2.0
        if error < smallest_error:
            best, smallest_error = body.material, error
        if error < TOLERANCE:
            break
        sensitivities = TetVibration(body).energies(shapes[:count]) / found[:count, None] ** 2
        # Apply the factor that all modes share equally to all tetrahedra. The least-squares solution would
        # distribute this factor unevenly.
        common = gaps.mean()
        factors += common + np.linalg.pinv(sensitivities, rcond=RCOND) @ (gaps - common)
        median = np.median(factors)
        factors = median + np.clip(factors - median, -np.log(MAX_CHANGE), np.log(MAX_CHANGE))
    if smallest_error > WARNING_ERROR:
        _log.warning(
            "the lowest frequencies of %r differ by up to %.0f %% from those of the finest level: it is too "
            "coarse for less",
            coarse.mesh,
            100.0 * smallest_error,
        )
    assert isinstance(best, Material)
    return best
