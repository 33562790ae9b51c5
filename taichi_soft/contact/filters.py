"""Groups and masks: which bodies and colliders touch. Both can change between two steps."""

from __future__ import annotations

from collections.abc import Sequence

from taichi_soft.bodies.soft_body import SoftBody, context_of
from taichi_soft.contact.kernels.filters import write_filter
from taichi_soft.control.change import change, require_per_body
from taichi_soft.core.checks import as_count
from taichi_soft.core.constants import ALL_GROUPS

Filter = tuple[int, int]
"""Group and mask, as bits."""


def as_filter(group: int, mask: int) -> Filter:
    """Return group and mask. Raises: OptionError for a value that is no bit field."""
    return as_count(group, "group", 0, ALL_GROUPS), as_count(mask, "mask", 0, ALL_GROUPS)


def may_meet(one: Sequence[int], other: Sequence[int]) -> bool:
    """True if the mask of each has a bit of the other's group."""
    return bool(one[0] & other[1] and other[0] & one[1])


def filter_of(body: SoftBody) -> Filter:
    """Return the current group and mask of a body."""
    fields = context_of(body).fields
    if fields is None:
        return body.asset.contact.filter
    group, mask = fields.state.body_filter[body.index]
    return int(group), int(mask)


def set_filter(body: SoftBody, group: int, mask: int) -> None:
    """Implement `Body.set_filter`."""
    context, new = context_of(body), as_filter(group, mask)
    built = context.built
    require_per_body(context, "groups and masks")
    if new == filter_of(body):
        return
    change(body, write_filter, body.index, *new)
    built.wake_near(*built.box_of(body))  # what lies on the body, or leans on it
    built.on_placed(body)  # bodies that now touch can overlap
    built.on_filtered()
