"""Groups and masks of bodies."""

from taichi_soft.core.runtime import ti


@ti.func
def may_touch(state: ti.template(), a, b):
    """True if the groups and masks of two bodies allow contact."""
    mine, theirs = state.body_filter[a], state.body_filter[b]
    return (mine[0] & theirs[1]) != 0 and (theirs[0] & mine[1]) != 0


@ti.kernel
def write_filter(state: ti.template(), body: ti.i32, group: ti.i32, mask: ti.i32):
    """Write group and mask of a body."""
    state.body_filter[body] = ti.Vector([group, mask])
