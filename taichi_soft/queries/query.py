"""Helpers that all queries share: checks of arguments, and the layout of results."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.fields import BodyFields
from taichi_soft.bodies.soft_body import Context, SoftBody
from taichi_soft.contact.collider import Collider, row_of
from taichi_soft.contact.colliders import Colliders
from taichi_soft.control.change import require_per_body
from taichi_soft.core.checks import as_count, as_number
from taichi_soft.core.constants import ALL_GROUPS
from taichi_soft.core.errors import OptionError

Floats = NDArray[np.float64]
ChosenColliders = bool | Iterable[Collider]
"""Colliders that a query tests: True for all, False for none, or a list."""

_UNLIMITED = 3e38
"""Largest distance [m] or squared distance [m^2]. It replaces infinity, which the kernels do not handle."""


def as_max_distance(max_distance: float) -> float:
    """Return `max_distance` [m] if it is above 0 or infinite. Raises: OptionError otherwise."""
    if isinstance(max_distance, (float, np.floating)) and max_distance == math.inf:
        return math.inf
    limit = as_number(max_distance, "max_distance", 0.0, math.inf, "a number above 0 m, or infinity")
    if limit == 0.0:
        raise OptionError("max_distance must be a number above 0 m, or infinity, got 0")
    return limit


def next_above(limit: float) -> float:
    """Return the next float32 above `limit`.

    Kernels accept only distances below the limit that they get, but a distance equal to `limit` is valid.
    """
    return float(np.nextafter(np.float32(min(limit, _UNLIMITED)), np.float32(np.inf)))


@dataclass(frozen=True, eq=False)
class Targets:
    """Bodies and colliders that a query tests, in ascending order."""

    state: BodyFields
    slots: Sequence[SoftBody | None]  # the body in each slot, None for an empty slot
    bodies: NDArray[np.int32]
    colliders: NDArray[np.int32]
    poses: NDArray[np.float32]  # (n, 7): position [m] and quaternion of each collider to test
    handles: Sequence[Collider]  # the colliders that exist

    def body(self, index: int) -> SoftBody | None:
        """Return the body in a slot; None for -1."""
        return self.slots[index] if index >= 0 else None

    def collider(self, index: int) -> Collider | None:
        """Return the collider with an index; None for -1."""
        return next((each for each in self.handles if each.index == index), None)


def targets_of(
    context: Context,
    bodies: Iterable[SoftBody] | None = None,
    colliders: ChosenColliders = False,
    mask: int = ALL_GROUPS,
) -> Targets:
    """Return what a query tests: see `World.raycast`.

    Raises: OptionError for a body or collider of another world, or an invalid mask; StateError before
        `World.build`, and for colliders with the schedule "flat".
    """
    built, groups = context.built, as_count(mask, "mask", 0, ALL_GROUPS)
    is_meant = None  # by slot; None: every body
    if groups != ALL_GROUPS:
        is_meant = built.state.body_filter.to_numpy()[:, 0] & groups != 0
    chosen = _as_body_indices(bodies, context.slots.slots, is_meant)
    handles = context.of(Colliders).handles
    rows = [row_of(each) for each in _as_colliders(colliders, handles, groups)]
    if colliders is not False:
        require_per_body(context, "queries on colliders")
    poses = np.array([[*row.position, *row.rotation] for row in rows], dtype=np.float32).reshape(-1, 7)
    found = {id(row_of(each)): each.index for each in handles}
    indices = np.array([found[id(row)] for row in rows], dtype=np.int32)
    return Targets(built.state, context.slots.slots, chosen, indices, poses, handles)


def _as_colliders(colliders: ChosenColliders, handles: Sequence[Collider], groups: int) -> Sequence[Collider]:
    """Return the colliders to test, ascending. Raises: OptionError."""
    requested = [each for each in handles if not each.is_sensor] if colliders is True else []
    if not isinstance(colliders, bool):
        try:
            requested = list(colliders)
        except TypeError:
            raise OptionError(
                f"colliders must be True, False or a list of this world's colliders, got {colliders!r}"
            ) from None
    for each in requested:
        if not any(each is one for one in handles):
            raise OptionError(
                f"colliders must be True, False or a list of this world's colliders, but one is {each!r}"
            )
    ordered = sorted({each.index: each for each in requested}.items())
    return [each for _, each in ordered if each.group & groups]


def _as_body_indices(
    bodies: Iterable[SoftBody] | None, handles: Sequence[SoftBody | None], is_meant: NDArray[np.bool_] | None
) -> NDArray[np.int32]:
    """Return the indices of the bodies to test, ascending; None selects all bodies. Raises: OptionError."""
    if bodies is None:
        every = [body.index for body in handles if body is not None]
        return np.array([i for i in every if is_meant is None or is_meant[i]], dtype=np.int32)
    try:
        requested = list(bodies)
    except TypeError:
        raise OptionError(f"bodies must be a list of this world's bodies or None, got {bodies!r}") from None
    chosen = set()
    for body in requested:
        index = getattr(body, "index", None)
        if not isinstance(index, int) or not 0 <= index < len(handles) or handles[index] is not body:
            raise OptionError(f"bodies must be a list of this world's bodies or None, but one is {body!r}")
        if is_meant is None or is_meant[body.index]:
            chosen.add(index)
    return np.array(sorted(chosen), dtype=np.int32)


def unpack_result(row: NDArray[np.float32]) -> tuple[int, int, float, Floats, Floats, Floats]:
    """Unpack body, face, distance, weights, point and normal from a row of `write_result`."""
    real = row.astype(np.float64)
    return int(real[10]), int(real[11]), float(real[0]), real[1:4], real[4:7], real[7:10]
