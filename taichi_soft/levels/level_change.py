"""Change the level of detail of a body, which then continues with more or fewer tetrahedra.

`Passage` maps the positions and velocities before and after the last step to the new mesh, by the same scheme
as a skin. If the body is free, its positions are then shifted and a rigid motion is added to its velocities.
The shift and the rigid motion preserve centre of mass, momentum and angular momentum to round-off.
Deformation that is finer than the new mesh is lost with its energy. A body that is held stays held at the
corresponding vertices of the new mesh.
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
from taichi_soft.fracture.cutting import write_slot, write_surface
from taichi_soft.fracture.kernels.topology import MOTION_WIDTH, read_motion
from taichi_soft.levels.kernels.map_motion import INV_MASS, map_motion
from taichi_soft.levels.passage import Passage, passage
from taichi_soft.levels.reattaching import Reattachments, reattachments_at, update_handles, write_targets

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


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
    write_targets(reattachments, motion, rows, np.array(state.body_origin[body.index], dtype=np.float64))
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
    """Return the reason why the level of a body cannot change now, with a fix; "" if the level can change.

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
    """Find the vertices that stay held at another level, and release the handles that cannot be kept there.

    Returns: the released handles; the vertices that will be pinned; the attachments with their vertices.

    Raises: StateError if an attachment would hold nothing and `may_release` is False.
    """
    released: list[Handle] = []
    for each in context_of(body).slices:
        if each.prevents_levels and isinstance(each, Numbered):
            released += each.holding(body)
            each.release_body(body)
    while True:  # repeat, because a release can leave other attachments without vertices
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
    """Return the rows of `read_motion` for the vertices of the new level, (m, MOTION_WIDTH).

    Args:
        motion: rows of the old level.
        masses: masses of the new level's vertices, (m,) [kg].
        held: vertices of the new level that will be pinned.
    """
    is_pinned, nearest = motion[:, INV_MASS] == 0.0, np.full(len(masses), -1, dtype=np.int32)
    if len(held):
        sources = np.flatnonzero(is_pinned)
        nearest[held] = sources[over.nearest_sources(held, sources)]
    rows = np.empty((len(masses), MOTION_WIDTH))
    weights = is_pinned / max(int(is_pinned.sum()), 1)
    map_motion(motion, *over.rows.values(), masses, *over.vertices, weights, nearest, rows)
    return rows


def _finest_held(body: SoftBody) -> Ints | None:
    """Return the vertices of the finest level that correspond to the pinned vertices; None without pins."""
    record, present = record_of(body), body.pinned.astype(np.int64)
    if not len(present):
        return None
    if record.level == 0:
        return present
    if record.held is not None and np.array_equal(_nearest_at(body, record.held, record.level), present):
        return record.held
    # The pinned vertices have changed since `record.held` was stored: find the nearest vertices again.
    return passage(body.asset, record.level, 0).nearest(present)


def _nearest_at(body: SoftBody, finest: Ints | None, level: int) -> Ints:
    """Return the vertices of `level` that are nearest to the vertices `finest` of level 0, ascending."""
    if finest is None:
        return np.zeros(0, dtype=np.int64)
    return np.unique(finest if level == 0 else passage(body.asset, 0, level).nearest(finest))
