"""List the candidates that can touch within a substep.

Groups of fields: reads islands; writes soft.
"""

from taichi_soft.contact.fields import NO_CONTACT
from taichi_soft.core.constants import LANES, ROW_BITS
from taichi_soft.core.runtime import ti


@ti.func
def _largest_of_sides(values: ti.template(), points, is_edge: ti.template(), least):
    """Return the largest values at the points of a feature and of its partner, and at least `least`."""
    mine, theirs = ti.max(least, values[points[0]]), ti.max(least, values[points[2]], values[points[3]])
    if ti.static(is_edge):
        mine = ti.max(mine, values[points[1]])
    else:
        theirs = ti.max(theirs, values[points[1]])
    return mine, theirs


@ti.func
def list_near_candidates(
    state: ti.template(), first_slot, slots, first_row, is_edge: ti.template(), impact_speed, h
):
    """List the candidates that can touch within the substep, in `near_slot` from `first_row` on.

    Args:
        first_slot, slots: first row and number of the candidates.
        is_edge: True for candidates of edges, False for candidates of vertices.
        impact_speed: speed that either body can gain from impacts [m/s].
        h: substep [s].
    Returns: the number of listed candidates.
    """
    count = 0
    for block in range((slots + LANES - 1) // LANES):
        first = (first_slot + block * LANES) & ROW_BITS
        is_near = ti.Vector.zero(ti.i32, LANES)
        for lane in range(LANES):
            points = state.soft.slot_points[first + lane]
            mine, theirs = _largest_of_sides(state.soft.particle_gone, points, is_edge, 0.0)
            my_speed, their_speed = _largest_of_sides(state.particle_speed, points, is_edge, impact_speed)
            range_now = mine + theirs + h * (my_speed + their_speed)
            is_near[lane] = ti.cast(state.soft.slot_spare[first + lane] < range_now, ti.i32)
        for lane in range(ti.min(LANES, slots - block * LANES)):
            # Branch-free: the branch mispredicts too often.
            state.soft.near_slot[first_row + count] = first + lane
            count += is_near[lane]
    return count


@ti.func
def contact_range(state: ti.template(), slot, is_edge: ti.template(), impact_speed, h):
    """Return the distance at which a candidate touches, and its approach within the substep [m].

    The second result is the largest distance by which the two sides can approach each other. If one of the
    two bodies explodes, it is -NO_CONTACT, so that the two never touch.
    """
    points = state.soft.slot_points[slot]
    mine, other = state.particle_body[points[0]], state.particle_body[points[3]]
    thickness = 0.5 * (state.body_surface[mine].y + state.body_surface[other].y)
    my_speed, their_speed = _largest_of_sides(state.particle_speed, points, is_edge, impact_speed)
    is_exploding = state.islands.is_exploding[mine] + state.islands.is_exploding[other]
    return thickness, ti.select(is_exploding > 0, -NO_CONTACT, h * (my_speed + their_speed))
