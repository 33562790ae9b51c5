"""Change of a body's level of detail: it continues with more or fewer tetrahedra.

`Passage` maps positions and velocities, now and before the last step, as a skin is mapped. If the body is
free, a correction of its position and a rigid motion added to its velocities then preserve centre of mass,
momentum and angular momentum to round-off. Deformation finer than the new mesh is lost, with its energy. A
body that is held stays held at the corresponding vertices of the new mesh.
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
from taichi_soft.levels.passage import Passage, passage
from taichi_soft.levels.reattaching import Reattachments, reattachments_at, update_handles, write_targets
from taichi_soft.levels.rigid_fit import fitting_motion, moments

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

POSITION, VELOCITY, EARLIER_POSITION, EARLIER_VELOCITY = (slice(k, k + 3) for k in (0, 3, 6, 9))
INV_MASS, MASS, AIM = 12, 15, 16
TARGET, PUSH = slice(17, 20), slice(20, 23)
"""Columns of `read_motion`."""


def set_level(body: SoftBody, level: Any, release: Any) -> tuple[Handle, ...]:
    """See `Body.set_level`. Returns: the released handles."""
    context = context_of(body)
    may_release = as_flag(release, "release")
    before = record_of(body).level
    requested = as_count(level, "level", 0)
    count = len(body.asset.levels)
    if requested >= count:
        levels = f"levels 0 to {count - 1}: pass one of them"
        if count == 1:
            levels = "only level 0: from_surface(cells=(12, 8, 5)) creates several levels"
        raise OptionError(f"level is {requested}, but body {body.index} has {levels}")
    reason = reason_against_level_change(body, may_release=may_release)
    if reason:
        raise StateError(reason)
    if requested == before:
        return ()
    state, target = context.built.state, body.asset.levels[requested]
    over, arrays = passage(body.asset, before, requested), target.arrays
    released, held, reattachments = _reattach(body, over, requested, may_release=may_release)
    grabbed = [(grab, place_of(grab)) for grab in context.of(Grabs).holding(body)]
    found = np.empty((body.vertex_count, MOTION_WIDTH), dtype=np.float32)
    read_motion(state, body.index, found)
    motion = found.astype(np.float64)
    rows = _mapped_rows(over, motion, target.description.masses, held)
    write_targets(reattachments, motion, rows)
    status = int(state.body_status[body.index])
    write_slot(context, state, body.index, arrays, rows.astype(np.float32), status, body.index, None)
    write_surface(context, state, body.index, target)
    context.built.on_placed(body)
    record_of(body).set_topology(None, requested)
    redescribe(body, target.description, arrays)
    if record_of(body).friction is not None:
        give_friction(state, body, body.friction)
    update_handles(reattachments)
    for grab, place in grabbed:
        hold_at(grab, place)
    context.built.on_cut(body)
    context.built.mark_modified(body.index)
    return tuple(released)


def reason_against_level_change(body: SoftBody, *, may_release: bool = False) -> str:
    """Reason why the level of a body cannot change now, with a fix; "" if it can change.

    Args: may_release: True to release handles that the other level cannot keep.
    Raises: StateError if the body or its world was removed.
    """
    context = context_of(body)
    if context.fields is None:
        return "the world is not built: call world.build() before a level changes"
    holds = [each.name for each in context.slices if each.prevents_levels and each.holds(body)]
    if holds and not may_release:
        return (
            f"body {body.index} has {' and '.join(holds)} that name its vertices: release or remove them "
            "before its level changes, or pass release=True to set_level"
        )
    if body.is_frozen:
        return f"body {body.index} is frozen: reactivate it with set_motion before its level changes"
    if record_of(body).description is not present_asset(body).description:
        return (
            f"body {body.index} has a material of its own, which its other levels do not have: spawn a new "
            "body from an asset of that material"
        )
    return ""


def _reattach(
    body: SoftBody, over: Passage, level: int, *, may_release: bool
) -> tuple[list[Handle], Ints, Reattachments]:
    """Find the vertices that stay held at another level, and release the handles that would hold none.

    Returns: the released handles; the vertices that will be pinned; the attachments that will hold them.

    Raises: StateError if an attachment would hold nothing and `may_release` is False.
    """
    released: list[Handle] = []
    for each in context_of(body).slices:
        if each.prevents_levels and isinstance(each, Numbered):
            released += each.holding(body)
            each.release_body(body)
    while True:  # a release leaves fewer pinned vertices, so that other attachments can lose theirs
        finest = _finest_held(body)
        held = _nearest_at(body, finest, level)
        reattachments = reattachments_at(body, over, held)
        lost = [each for each, particles in reattachments if not len(particles)]
        if lost and not may_release:
            raise StateError(
                f"{lost[0]!r} would hold nothing at level {level}, which has no vertices of its own for it: "
                "release it before the level changes, or pass release=True to set_level"
            )
        record_of(body).held = finest
        if not lost:
            return released, held, reattachments
        for each in lost:
            each.release()
        released += lost


def _mapped_rows(over: Passage, motion: Floats, masses: Floats, held: Ints) -> Floats:
    """Rows of `read_motion` for the vertices of the new level. Args: held: vertices that are pinned."""
    old = motion[:, MASS]
    rows = np.zeros((len(masses), MOTION_WIDTH))
    rows[:, :INV_MASS] = over(motion[:, :INV_MASS])
    rows[:, MASS], rows[:, INV_MASS] = masses, 1.0 / masses
    if len(held):
        _pin(over, motion, rows, held)
    else:  # the momentum of a held body is not conserved
        for x, v in ((POSITION, VELOCITY), (EARLIER_POSITION, EARLIER_VELOCITY)):
            _preserve_momentum(motion[:, x], motion[:, v], old, rows[:, x], rows[:, v], masses)
    center = weighted_sum(old, motion[:, POSITION]) / old.sum()
    force = motion[:, PUSH]
    torque = np.cross(motion[:, POSITION] - center, force).sum(axis=0)
    rows[:, PUSH] = masses[:, None] * _rigid(rows[:, POSITION] - center, masses, force.sum(axis=0), torque)
    return rows


def _pin(over: Passage, motion: Floats, rows: Floats, held: Ints) -> None:
    """Pin vertices in the state of the nearest vertices that are pinned in the old level.

    The pinned vertices follow the rigid motion that fits the old ones best, plus the deviation of the nearest
    old one from it. So their arrangement does not drift over repeated changes of level.
    """
    sources = np.flatnonzero(motion[:, INV_MASS] == 0.0)
    nearest = sources[over.nearest_sources(held, sources)]
    before, after = over.vertices
    for columns in (POSITION, EARLIER_POSITION):
        rotation, translation = (
            kept(each) for each in fitting_motion(before[sources], motion[sources, columns])
        )
        deviation = motion[nearest, columns] - (turned(before[nearest], rotation) + translation)
        rows[held, columns] = turned(after[held], rotation) + translation + deviation
    rows[held, INV_MASS] = 0.0
    rows[held, VELOCITY] = motion[nearest, VELOCITY]
    rows[held, AIM] = motion[nearest, AIM]
    rows[held, TARGET] = motion[nearest, TARGET] + rows[held, POSITION] - motion[nearest, POSITION]


def _preserve_momentum(x: Floats, v: Floats, m: Floats, new_x: Floats, new_v: Floats, masses: Floats) -> None:
    """Shift `new_x` and change `new_v` to the centre, momentum and angular momentum of `x` and `v`."""
    center = weighted_sum(m, x) / m.sum()
    new_x += center - weighted_sum(masses, new_x) / masses.sum()
    offsets = new_x - center
    momentum = weighted_sum(m, v) - weighted_sum(masses, new_v)
    new_v += _rigid(
        offsets,
        masses,
        momentum,
        _angular_momentum(x - center, v, m) - _angular_momentum(offsets, new_v, masses),
    )


def _rigid(offsets: Floats, masses: Floats, momentum: Floats, angular_momentum: Floats) -> Floats:
    """Velocities (n, 3) of the rigid motion with a momentum and an angular momentum about the centre of mass.

    Or accelerations, from a force and a torque.

    Args: offsets: positions of the particles about the centre of mass [m], (n, 3).
    """
    offsets = offsets - weighted_sum(masses, offsets) / masses.sum()
    second_moments = moments(masses, offsets, offsets)
    # The small increase keeps the inertia regular where all particles lie on one line.
    inertia = np.trace(second_moments) * (1.0 + 1e-9) * np.eye(3) - second_moments
    a, b, c = shares_by(edge_inverses(np.vstack([np.zeros(3), inertia])), angular_momentum)[1:]
    cross_matrix = np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]])  # angular velocity x r = cross_matrix @ r
    return np.asarray(momentum / masses.sum() + turned(offsets, cross_matrix))


def _finest_held(body: SoftBody) -> Ints | None:
    """Vertices of the finest level that correspond to the vertices pinned now; None if none is pinned."""
    record, present = record_of(body), body.pinned.astype(np.int64)
    if not len(present):
        return None
    if record.level == 0:
        return present
    if record.held is not None and np.array_equal(_nearest_at(body, record.held, record.level), present):
        return record.held
    # The pinned vertices have changed since: take the nearest ones of the finest level.
    return passage(body.asset, record.level, 0).nearest(present)


def _nearest_at(body: SoftBody, finest: Ints | None, level: int) -> Ints:
    """Vertices of a level that are nearest to the given ones of the finest level, ascending."""
    if finest is None:
        return np.zeros(0, dtype=np.int64)
    return np.unique(finest if level == 0 else passage(body.asset, 0, level).nearest(finest))


def _angular_momentum(offsets: Floats, v: Floats, masses: Floats) -> Floats:
    """Sum of m r x v, (3,) [kg m^2/s]."""
    products = moments(masses, offsets, v)
    return np.array([products[i - 2, i - 1] - products[i - 1, i - 2] for i in range(3)])
