"""Solve contacts of rigid bodies, with each other and with soft bodies.

The impulse of a contact acts at one point on both bodies, so that angular momentum is conserved. The point is
that of the soft body or, between two rigid bodies, in the middle. The points of a soft body get the impulse
times their weights.

Groups of fields: reads hull, rigid; writes soft.
"""

from taichi_soft.bodies.kernels.rigid import (
    is_rigid,
    push_rigid,
    rigid_mobility,
    rigid_velocity,
    shift_rigid,
)
from taichi_soft.contact.kernels.hull_points import apply_point_impulse, motion_of, shift_point
from taichi_soft.core.math.finite import is_finite
from taichi_soft.core.runtime import ti


@ti.func
def _sides_of(state: ti.template(), slot):
    """Return the two bodies of a contact, and the point at which its impulse acts [m]."""
    points, weights = state.soft.slot_points[slot], state.soft.slot_weights[slot]
    body, other = state.particle_body[points[0]], state.particle_body[points[3]]
    mine, theirs = ti.Vector.zero(ti.f32, 3), ti.Vector.zero(ti.f32, 3)
    for i in ti.static(range(4)):
        x = state.particle_position[points[i]]
        if state.particle_body[points[i]] == body:
            mine += weights[i] * x
        else:
            theirs -= weights[i] * x
    place = 0.5 * (mine + theirs)
    if not is_rigid(state, body):
        place = mine
    if not is_rigid(state, other):
        place = theirs
    return body, other, place


@ti.func
def _approach_and_mobility(state: ti.template(), slot, body, other, place):
    """Return the relative velocity of a contact's sides [m/s], and the matrix that maps impulses to it."""
    points, weights = state.soft.slot_points[slot], state.soft.slot_weights[slot]
    # The entries of rigid bodies are zero.
    of_soft = weights.dot(state.hull.slot_mobility[slot] @ weights)
    velocity, mobility = ti.Vector.zero(ti.f32, 3), of_soft * ti.Matrix.identity(ti.f32, 3)
    for side in ti.static(range(2)):
        each = body if ti.static(side == 0) else other
        sign = ti.static(1.0 - 2.0 * side)
        if is_rigid(state, each):
            if state.rigid.inv_mass[each] > 0.0:
                mobility += rigid_mobility(state, each, place)
            velocity += sign * rigid_velocity(state, each, place)
    for i in ti.static(range(4)):
        if not is_rigid(state, state.particle_body[points[i]]):
            velocity += weights[i] * state.soft.slot_moves[slot][i] * motion_of(state, points[i])[1]
    return velocity, mobility


@ti.func
def _apply(state: ti.template(), slot, body, other, place, impulse):
    """Apply an impulse to the first side of a contact, and the opposite one to the second side."""
    points, weights = state.soft.slot_points[slot], state.soft.slot_weights[slot]
    if is_rigid(state, body):
        push_rigid(state, body, place, impulse)
    if is_rigid(state, other):
        push_rigid(state, other, place, -impulse)
    for i in range(4):
        if not is_rigid(state, state.particle_body[points[i]]):
            apply_point_impulse(state, points[i], weights[i] * impulse)


@ti.real_func
def solve_rigid_contact(
    state: ti.template(), slot: ti.i32, friction: ti.f32, h: ti.f32, is_first: ti.i32
) -> ti.i32:
    """Do the same as `contact_solver` for a contact with a rigid body.

    Returns: 1 if the two sides are pressed together, else 0.
    """
    body, other, place = _sides_of(state, slot)
    normal = state.soft.slot_normal[slot]
    normal_impulse, friction_impulse = (
        state.soft.slot_normal_impulse[slot],
        state.soft.slot_friction_impulse[slot],
    )
    change = normal_impulse * normal + friction_impulse
    if is_first == 0:
        velocity, mobility = _approach_and_mobility(state, slot, body, other, place)
        allowed = -ti.max(state.soft.slot_gap[slot], 0.0) / h
        along = ti.max(normal.dot(mobility @ normal), 1e-30)
        wanted = ti.max(normal_impulse + (allowed - velocity.dot(normal)) / along, 0.0)
        change = (wanted - normal_impulse) * normal
        velocity += mobility @ change
        sliding = velocity - velocity.dot(normal) * normal
        way = sliding / ti.max(sliding.norm(), 1e-30)
        wanted_friction = friction_impulse - sliding / ti.max(way.dot(mobility @ way), 1e-30)
        wanted_friction -= wanted_friction.dot(normal) * normal
        wanted_friction *= ti.min(1.0, friction * wanted / ti.max(wanted_friction.norm(), 1e-30))
        change += wanted_friction - friction_impulse
        if is_finite(change) == 1:  # what is not finite could not be restored from a snapshot
            normal_impulse = wanted
            state.soft.slot_normal_impulse[slot] = wanted
            state.soft.slot_friction_impulse[slot] = wanted_friction
    if is_finite(change) == 1:
        _apply(state, slot, body, other, place, change)
    return int(normal_impulse > 0.0)


@ti.real_func
def separate_rigid(state: ti.template(), slot: ti.i32, distance: ti.f32):
    """Move the sides of a contact apart by `distance` [m]. Velocities do not change."""
    body, other, place = _sides_of(state, slot)
    normal, points = state.soft.slot_normal[slot], state.soft.slot_points[slot]
    _, mobility = _approach_and_mobility(state, slot, body, other, place)
    total = normal.dot(mobility @ normal)
    if total > 0.0:
        impulse = distance / total * normal
        if is_rigid(state, body):
            shift_rigid(state, body, place, impulse)
        if is_rigid(state, other):
            shift_rigid(state, other, place, -impulse)
        for i in range(4):
            if not is_rigid(state, state.particle_body[points[i]]):
                shift_point(state, points[i], state.soft.slot_weights[slot][i] * impulse)
