"""Move whole bodies by a rigid motion, without changing their deformation."""

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
    """Rotate a body about its centre of mass, and move it so that this centre is at `center` [m].

    Args:
        body: body to move.
        center: new centre of mass, (3,) [m].
        turn: rotation matrix, (3, 3).
        lowest: smallest allowed height [m].
        keep: True rotates the velocities, False stops the body.
    Returns: lowest height, highest height and largest coordinate of the moved body [m]. If the lowest height
        is below `lowest` or the coordinate is out of range, the body was not moved. Otherwise, the caller
        must call `mark_modified`.
    """
    found = np.empty(3)
    attempt(body, jump, body.index, np.array([*center, lowest, float(keep)]), turn, found)
    bottom, top, farthest = found.tolist()
    return bottom, top, farthest


def carry(bodies: Sequence[SoftBody], turn: Floats, start: Floats, end: Floats, *, keep: bool) -> None:
    """Rotate bodies by `turn` about the point `start`, move this point to `end` [m], and wake nearby bodies.

    Raises: OptionError if a body would be out of range. In that case, no body is moved.
    """
    centers = [turned((body.center_of_mass() - start)[None], turn)[0] + end for body in bodies]
    for body, center in zip(bodies, centers, strict=True):
        _, _, farthest = jump_to(body, center, turn, lowest=np.inf, keep=keep)  # measures only
        if not farthest < POSITION_LIMIT:
            raise OptionError(
                f"position puts body {body.index} beyond {POSITION_LIMIT:g} m: move it closer to the origin"
            )
    for body, center in zip(bodies, centers, strict=True):
        simulation = context_of(body).built
        left = simulation.box_of(body)
        jump_to(body, center, turn, lowest=-np.inf, keep=keep)
        mark_modified(body)
        simulation.wake_near(*left)
