"""Move the origin of a world's coordinates, with everything in the world."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from taichi_soft.control.kernels.origin import shift_places
from taichi_soft.core.checks import as_vector
from taichi_soft.core.constants import POSITION_LIMIT
from taichi_soft.core.errors import OptionError
from taichi_soft.solver.context import WorldContext


def shift_origin(context: WorldContext, offset: ArrayLike) -> None:
    """Implement `World.shift_origin`."""
    state, origin = context.built.state, as_vector(offset, "offset", "m")
    farthest = np.zeros(1)
    shift_places(state, 0, origin, farthest)
    others = [each.position for each in context.colliders.handles]
    for place in others:
        farthest = np.maximum(farthest, np.abs(place - origin).max())
    if not farthest[0] < POSITION_LIMIT:
        raise OptionError(
            f"offset={origin.tolist()} puts a body or collider {farthest[0]:.4g} m from the new origin: "
            f"stay below {POSITION_LIMIT:g} m"
        )
    shift_places(state, 1, origin, farthest)
    for each in context.slices:
        each.shift_origin(origin)
    if context.settings.floor is not None:
        context.apply_settings(replace(context.settings, floor=context.settings.floor - float(origin[2])))
    readout = context.built.readout
    readout.set_view_origin(readout.view_origin - origin if readout.view_origin.any() else np.zeros(3))
    context.built.mark_changed()
