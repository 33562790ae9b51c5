"""Jumps of whole bodies, deformed as they are, by a rigid motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.soft_body import SoftBody, context_of
from taichi_soft.control.change import attempt, mark_modified
from taichi_soft.control.kernels.rigid_motion import jump
from taichi_soft.core.constants import POSITION_LIMIT
from taichi_soft.core.errors import OptionError
from taichi_soft.core.math.rotations import turned

Floats = NDArray[np.float64]


def jump_to(
    body: SoftBody, center: Floats, turn: Floats, *, lowest: float, keep: bool
) -> tuple[float, float, float]:
    """Turn a body about its centre of mass and put that at `center`, its velocity turned or stopped.

    Returns: its lowest height, its highest, and its largest coordinate then [m]. Where the first is below
        `lowest` or the last out of reach, nothing was changed; else the caller has to `mark_modified` it.
    """
    found = np.empty(3)
    attempt(body, jump, body.index, np.array([*center, lowest, float(keep)]), turn, found)
    bottom, top, farthest = found.tolist()
    return bottom, top, farthest


def carry(bodies: Sequence[SoftBody], turn: Floats, start: Floats, end: Floats, *, keep: bool) -> None:
    """Move bodies by the rigid motion that takes the point `start` to `end` [m], and wake what lay on them.

    Raises: OptionError, with nothing changed, where one of them would be out of reach.
    """
    centers = [turned((body.center_of_mass() - start)[None], turn)[0] + end for body in bodies]
    for body, center in zip(bodies, centers, strict=True):
        _, _, farthest = jump_to(body, center, turn, lowest=np.inf, keep=keep)  # only looks
        if not farthest < POSITION_LIMIT:
            raise OptionError(
                f"position puts body {body.index} beyond {POSITION_LIMIT:g} m: stay nearer the origin"
            )
    for body, center in zip(bodies, centers, strict=True):
        simulation = context_of(body).built
        left = simulation.box_of(body)
        jump_to(body, center, turn, lowest=-np.inf, keep=keep)
        mark_modified(body)
        simulation.wake_near(*left)
