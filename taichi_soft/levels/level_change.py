"""A body that goes on with more or fewer tetrahedra.

Positions, velocities and what was before the last step pass over as a skin is drawn: see `Passage`. Then a
body that nothing holds is moved, and its velocities are given a rigid motion, so that centre of mass,
momentum and angular momentum are to round-off what they were. What is finer than the new mesh is lost, with
its energy. What holds the body goes on to hold it where the new mesh has its place.
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
from taichi_soft.control.frictions import give_friction
from taichi_soft.control.grabs import Grabs, hold_at, place_of
from taichi_soft.control.numbered import Numbered
from taichi_soft.core.checks import as_count, as_flag
from taichi_soft.core.errors import OptionError, StateError
from taichi_soft.core.handles import Handle
from taichi_soft.core.math.barycentric import edge_inverses, shares_by
from taichi_soft.core.math.rotations import turned
from taichi_soft.core.residue import kept, weighted_sum
from taichi_soft.fracture.cutting import write_slot, write_surface
from taichi_soft.fracture.kernels.topology import MOTION_WIDTH, read_motion
from taichi_soft.levels.fitting import fitting_motion, moments
from taichi_soft.levels.hanging import Hanging, hang_on, hanging_at, let_hold
from taichi_soft.levels.passage import Passage, passage

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

POSITION, VELOCITY, EARLIER_POSITION, EARLIER_VELOCITY = (slice(k, k + 3) for k in (0, 3, 6, 9))
INV_MASS, MASS, AIM = 12, 15, 16
TARGET, PUSH = slice(17, 20), slice(20, 23)
"""Columns of `read_motion`."""


def set_level(body: SoftBody, level: Any, release: Any) -> tuple[Handle, ...]:
    """As `Body.set_level`. Returns: what was released."""
    context = context_of(body)
    may_release = as_flag(release, "release")
    before = record_of(body).level
    wanted = as_count(level, "level", 0)
    count = len(body.asset.levels)
    if wanted >= count:
        fix = f"give 0 to {count - 1}" if count > 1 else "from_surface with cells=(12, 8, 5) makes several"
        raise OptionError(f"level is {wanted}, and the asset of body {body.index} has {count}: {fix}")
    bar = bar_to_levels(body, may_release=may_release)
    if bar:
        raise StateError(bar)
    if wanted == before:
        return ()
    state, target = context.built.state, body.asset.levels[wanted]
    over, arrays = passage(body.asset, before, wanted), target.arrays
    released, held, hanging = _make_room(body, over, wanted, may_release=may_release)
    grabbed = [(grab, place_of(grab)) for grab in context.of(Grabs).holding(body)]
    found = np.empty((body.vertex_count, MOTION_WIDTH), dtype=np.float32)
    read_motion(state, body.index, found)
    motion = found.astype(np.float64)
    rows = _passed(over, motion, target.description.masses, held)
    hang_on(hanging, motion, rows)
    status = int(state.body_status[body.index])
    write_slot(context, state, body.index, arrays, rows.astype(np.float32), status, body.index, None)
    write_surface(context, state, body.index, target)
    context.built.was_placed(body)
    record_of(body).become(None, wanted)
    redescribe(body, target.description, arrays)
    if record_of(body).friction is not None:
        give_friction(state, body, body.friction)
    let_hold(hanging)
    for grab, place in grabbed:
        hold_at(grab, place)
    context.built.was_cut(body)
    context.built.rouse(body.index)
    return tuple(released)


def bar_to_levels(body: SoftBody, *, may_release: bool = False) -> str:
    """Why the level of a body cannot change now, and the way out; "" where it can.

    Args: may_release: what has no place at another level is no bar.
    Raises: StateError where the body or its world is gone.
    """
    context = context_of(body)
    if context.fields is None:
        return "the world is not built: call world.build() first, and change what moves"
    holds = [each.name for each in context.slices if each.bars_levels and each.holds(body)]
    if holds and not may_release:
        return (
            f"body {body.index} has {' and '.join(holds)} that name its vertices: release or remove them "
            "before its level changes, or let set_level do so with release=True"
        )
    if body.is_frozen:
        return f"body {body.index} is frozen: bring it back with set_motion before its level changes"
    if record_of(body).description is not present_asset(body).description:
        return (
            f"body {body.index} was given a material of its own, which its other levels do not have: spawn "
            "it anew from an asset of that material"
        )
    return ""


def _make_room(
    body: SoftBody, over: Passage, level: int, *, may_release: bool
) -> tuple[list[Handle], Ints, Hanging]:
    """Release what has no place at another level.

    Returns: that; the vertices that will be held; what will hold them.

    Raises: StateError where there is an attachment without a place that may not be released.
    """
    released: list[Handle] = []
    for each in context_of(body).slices:
        if each.bars_levels and isinstance(each, Numbered):
            released += each.holding(body)
            each.let_go(body)
    while True:  # without what was released fewer vertices are held, and others may have no place
        finest = _finest_held(body)
        held = _nearest_at(body, finest, level)
        hanging = hanging_at(body, over, held)
        homeless = [each for each, particles in hanging if not len(particles)]
        if homeless and not may_release:
            raise StateError(
                f"{homeless[0]!r} would hold nothing at level {level}, where its vertices have no place of "
                "their own: release it before the level changes, or let set_level do so with release=True"
            )
        record_of(body).held = finest
        if not homeless:
            return released, held, hanging
        for each in homeless:
            each.release()
        released += homeless


def _passed(over: Passage, motion: Floats, masses: Floats, held: Ints) -> Floats:
    """Rows of `read_motion` for the vertices of another level, of which some are held."""
    old = motion[:, MASS]
    rows = np.zeros((len(masses), MOTION_WIDTH))
    rows[:, :INV_MASS] = over(motion[:, :INV_MASS])
    rows[:, MASS], rows[:, INV_MASS] = masses, 1.0 / masses
    if len(held):
        _hold(over, motion, rows, held)
    else:  # a body that is held shares its momentum with what holds it
        for x, v in ((POSITION, VELOCITY), (EARLIER_POSITION, EARLIER_VELOCITY)):
            _keep_momentum(motion[:, x], motion[:, v], old, rows[:, x], rows[:, v], masses)
    center = weighted_sum(old, motion[:, POSITION]) / old.sum()
    push = motion[:, PUSH]
    torque = np.cross(motion[:, POSITION] - center, push).sum(axis=0)
    rows[:, PUSH] = masses[:, None] * _rigid(rows[:, POSITION] - center, masses, push.sum(axis=0), torque)
    return rows


def _hold(over: Passage, motion: Floats, rows: Floats, held: Ints) -> None:
    """Let vertices be held as those of the level before are that are nearest to each.

    What is held together stays together: the held ones move as a rigid body does that fits those before best,
    and each by what the nearest one is beside that. So nothing creeps from change to change.
    """
    sources = np.flatnonzero(motion[:, INV_MASS] == 0.0)
    nearest = sources[over.nearest_sources(held, sources)]
    before, after = over.places
    for part in (POSITION, EARLIER_POSITION):
        turn, place = (kept(each) for each in fitting_motion(before[sources], motion[sources, part]))
        beside = motion[nearest, part] - (turned(before[nearest], turn) + place)
        rows[held, part] = turned(after[held], turn) + place + beside
    rows[held, INV_MASS] = 0.0
    rows[held, VELOCITY] = motion[nearest, VELOCITY]
    rows[held, AIM] = motion[nearest, AIM]
    rows[held, TARGET] = motion[nearest, TARGET] + rows[held, POSITION] - motion[nearest, POSITION]


def _keep_momentum(x: Floats, v: Floats, m: Floats, new_x: Floats, new_v: Floats, masses: Floats) -> None:
    """Move `new_x` and change `new_v`, so that centre, momentum and angular momentum are those of x and v."""
    center = weighted_sum(m, x) / m.sum()
    new_x += center - weighted_sum(masses, new_x) / masses.sum()
    arms = new_x - center
    momentum = weighted_sum(m, v) - weighted_sum(masses, new_v)
    new_v += _rigid(arms, masses, momentum, _spin(x - center, v, m) - _spin(arms, new_v, masses))


def _rigid(arms: Floats, masses: Floats, momentum: Floats, spin: Floats) -> Floats:
    """Velocities of the rigid motion that has a momentum, and an angular momentum about the centre of mass;
    or accelerations, of a force and a torque. (n, 3), for places `arms` from about the centre."""
    arms = arms - weighted_sum(masses, arms) / masses.sum()
    own = moments(masses, arms, arms)
    # A little more, or there is none about the line on which all may lie.
    inertia = np.trace(own) * (1.0 + 1e-9) * np.eye(3) - own
    a, b, c = shares_by(edge_inverses(np.vstack([np.zeros(3), inertia])), spin)[1:]
    turning = np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]])  # spin x r = turning @ r
    return np.asarray(momentum / masses.sum() + turned(arms, turning))


def _finest_held(body: SoftBody) -> Ints | None:
    """Vertices of the finest level that what is held now stands for; None for none."""
    record, present = record_of(body), body.pinned.astype(np.int64)
    if not len(present):
        return None
    if record.level == 0:
        return present
    if record.held is not None and np.array_equal(_nearest_at(body, record.held, record.level), present):
        return record.held
    # Pinned meanwhile: what is nearest to that, in the finest level.
    return passage(body.asset, record.level, 0).nearest(present)


def _nearest_at(body: SoftBody, finest: Ints | None, level: int) -> Ints:
    """Vertices of a level that are nearest to some of the finest, ascending."""
    if finest is None:
        return np.zeros(0, dtype=np.int64)
    return np.unique(finest if level == 0 else passage(body.asset, 0, level).nearest(finest))


def _spin(arms: Floats, v: Floats, masses: Floats) -> Floats:
    """Sum of m r x v, (3,)."""
    products = moments(masses, arms, v)
    return np.array([products[i - 2, i - 1] - products[i - 1, i - 2] for i in range(3)])
