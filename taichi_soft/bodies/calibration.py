"""Constants with which a coarser mesh weighs and vibrates as a finer one.

A coarse mesh of linear tetrahedra is too stiff, more so in some modes than in others. Young's modulus of each
of its tetrahedra is therefore updated by the sensitivities of the modes (Friswell and Mottershead 1995): of a
mode u with u^T M u = 1, the share of tetrahedron t in u^T K u says by how much the square of the frequency
goes with its modulus. Of all moduli with the right frequencies those are taken that change least.
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
"""That are to have the same frequencies: what is seen of a body that wobbles are its slowest."""

EXACT = 2e-3
"""Change of squared frequencies at which modes are known well enough."""

CLOSE = 0.01
"""Of the frequencies, at which the update ends."""

PROMISED = 0.05
"""Beyond it a word is said."""

MOST_UPDATES = 6

ALIKE = 0.1
"""Singular values of the sensitivities below this part of the largest belong to modes that no modulus can
tell apart, such as the two bending modes of a round bar."""

MOST_CHANGE = 3.0
"""Of a modulus, as a factor beside that of all of them: beyond, the body would be of another kind."""


def calibrated(fine: BodyDescription, coarser: Sequence[BodyDescription]) -> list[Material]:
    """The materials of coarser bodies that give each the mass and the lowest frequencies of `fine`.

    Args: bodies of one material with a number for each constant.
    Returns: each with a Young's modulus for each tetrahedron.
    """
    wanted, _ = lowest_modes(fine, MODES, EXACT)
    return [_fitted(wanted, fine.masses.sum(), each) for each in coarser]


def _fitted(wanted: Floats, mass: float, coarse: BodyDescription) -> Material:
    """The material of `coarse` with which it has these angular frequencies [rad/s] and this mass [kg]."""
    material = coarse.material
    assert isinstance(material, Material)
    density = material.density * mass / coarse.masses.sum()
    factors = np.zeros(len(coarse.mesh.tets))  # logarithms
    best, least = coarse.material, np.inf
    for _ in range(MOST_UPDATES):
        young = material.young * np.exp(factors)
        body = replace(coarse, material=replace(material, young=young, density=density))
        found, shapes = lowest_modes(body, MODES, EXACT)
        count = min(len(wanted), len(found))
        gaps = 2.0 * np.log(wanted[:count] / found[:count])
        miss = float(np.abs(gaps).max(initial=0.0)) / 2.0
        if miss < least:
            best, least = body.material, miss
        if miss < CLOSE:
            break
        shares = TetVibration(body).energies(shapes[:count]) / found[:count, None] ** 2
        # A factor for all first: it costs nothing, where the sum of squares would spread it unevenly.
        whole = gaps.mean()
        factors += whole + np.linalg.pinv(shares, rcond=ALIKE) @ (gaps - whole)
        middle = np.median(factors)
        factors = middle + np.clip(factors - middle, -np.log(MOST_CHANGE), np.log(MOST_CHANGE))
    if least > PROMISED:
        _log.warning(
            "%r has lowest frequencies up to %.0f %% from those of the finest level: it is too coarse for "
            "more",
            coarse.mesh,
            100.0 * least,
        )
    assert isinstance(best, Material)
    return best
