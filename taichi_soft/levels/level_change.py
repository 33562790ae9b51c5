"""A body that goes on with more or fewer tetrahedra.

Positions, velocities and what was before the last step pass over as a skin is drawn: see `Passage`. Then the
body is moved, and its velocities are given a rigid motion, so that centre of mass, momentum and angular
momentum are to round-off what they were. What is finer than the new mesh is lost, with its energy.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.soft_body import (
    SoftBody,
    context_of,
    present_asset,
    record_of,
    redescribe,
)
from taichi_soft.core.checks import as_count
from taichi_soft.core.errors import OptionError, StateError
from taichi_soft.fracture.cutting import write_slot, write_surface
from taichi_soft.fracture.kernels.topology import MOTION_WIDTH, read_motion
from taichi_soft.levels.passage import Passage, passage

Floats = NDArray[np.float64]

POSITION, VELOCITY, EARLIER_POSITION, EARLIER_VELOCITY = (slice(k, k + 3) for k in (0, 3, 6, 9))
INV_MASS, MASS, AIM = 12, 15, 16
TARGET, PUSH = slice(17, 20), slice(20, 23)
"""Columns of `read_motion`."""


def set_level(body: SoftBody, level: Any) -> None:
    """As `Body.set_level`."""
    context = context_of(body)
    before = record_of(body).level
    wanted = as_count(level, "level", 0)
    count = len(body.asset.levels)
    if wanted >= count:
        raise OptionError(
            f"level is {wanted}, and the asset of body {body.index} has {count}: from_surface with "
            "cells=(12, 8, 5) makes several"
        )
    bar = bar_to_levels(body)
    if bar:
        raise StateError(bar)
    if wanted == before:
        return
    state, target = context.built.state, body.asset.levels[wanted]
    over, arrays = passage(body.asset, before, wanted), target.arrays
    motion = np.empty((body.vertex_count, MOTION_WIDTH), dtype=np.float32)
    read_motion(state, body.index, motion)
    rows = _passed(over, motion.astype(np.float64), target.description.masses).astype(np.float32)
    status = int(state.body_status[body.index])
    write_slot(context, state, body.index, arrays, rows, status, body.index, None)
    write_surface(context, state, body.index, target)
    record_of(body).become(None, wanted)
    redescribe(body, target.description, arrays)
    context.built.was_cut(body)
    context.built.rouse(body.index)


def bar_to_levels(body: SoftBody) -> str:
    """Why the level of a body cannot change now, and the way out; "" where it can.

    Raises: StateError where the body or its world is gone.
    """
    context = context_of(body)
    if context.fields is None:
        return "the world is not built: call world.build() first, and change what moves"
    holds = [each.name for each in context.slices if each.holds(body)]
    if holds:
        return (
            f"body {body.index} has {' and '.join(holds)} that name its vertices: release or remove them "
            "before its level changes"
        )
    if body.is_frozen:
        return f"body {body.index} is frozen: bring it back with set_motion before its level changes"
    if record_of(body).description is not present_asset(body).description:
        return (
            f"body {body.index} was given a material of its own, which its other levels do not have: spawn "
            "it anew from an asset of that material"
        )
    return ""


def _passed(over: Passage, motion: Floats, masses: Floats) -> Floats:
    """Rows of `read_motion` for the vertices of another level."""
    old = motion[:, MASS]
    rows = np.zeros((len(masses), MOTION_WIDTH))
    rows[:, :INV_MASS] = over(motion[:, :INV_MASS])
    for position, velocity in ((POSITION, VELOCITY), (EARLIER_POSITION, EARLIER_VELOCITY)):
        earlier = motion[:, position], motion[:, velocity]
        _keep_momentum(*earlier, old, rows[:, position], rows[:, velocity], masses)
    rows[:, MASS], rows[:, INV_MASS] = masses, 1.0 / masses
    rows[:, PUSH] = masses[:, None] / masses.sum() * motion[:, PUSH].sum(axis=0)
    held = np.flatnonzero(motion[:, INV_MASS] == 0.0)
    if len(held):
        places = over.nearest(held)
        rows[places, INV_MASS] = 0.0
        rows[places, VELOCITY] = motion[held, VELOCITY]
        rows[places, AIM] = motion[held, AIM]
        rows[places, TARGET] = motion[held, TARGET] + rows[places, POSITION] - motion[held, POSITION]
    return rows


def _keep_momentum(x: Floats, v: Floats, m: Floats, new_x: Floats, new_v: Floats, masses: Floats) -> None:
    """Move `new_x` and change `new_v`, so that centre, momentum and angular momentum are those of x and v."""
    center, drift = m @ x / m.sum(), m @ v / m.sum()
    new_x += center - masses @ new_x / masses.sum()
    new_v += drift - masses @ new_v / masses.sum()
    arms = new_x - center
    missing = _spin(x - center, v, m) - _spin(arms, new_v, masses)
    moments = (masses[:, None] * arms).T @ arms
    inertia = np.trace(moments) * np.eye(3) - moments
    a, b, c = np.linalg.lstsq(inertia, missing, rcond=1e-9)[0]
    new_v += arms @ np.array([[0, c, -b], [-c, 0, a], [b, -a, 0]])


def _spin(arms: Floats, v: Floats, masses: Floats) -> Floats:
    """Sum of m r x v, (3,)."""
    products = (masses[:, None] * arms).T @ v
    return np.array([products[i - 2, i - 1] - products[i - 1, i - 2] for i in range(3)])
