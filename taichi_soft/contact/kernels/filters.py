"""Groups and masks of bodies.

Groups of fields: reads colliders.
"""

from taichi_soft.core.runtime import ti


@ti.func
def may_touch(state: ti.template(), a, b):
    """True if the groups and masks of two bodies allow contact."""
    mine, theirs = state.colliders.body_filter[a], state.colliders.body_filter[b]
    return (mine[0] & theirs[1]) != 0 and (theirs[0] & mine[1]) != 0
