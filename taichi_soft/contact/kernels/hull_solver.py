"""Apply impulses between hull points and triangles of hull points, as `contact_solver` does for particles.

A particle is a point that carries itself. The corners of a triangle can share carriers. An impulse at one
corner then also changes the velocities of the other corners, according to `HullFields.slot_mobility`.

Groups of fields: writes hull, soft.
"""

from taichi_soft.contact.kernels.hull_points import (
    apply_point_impulse,
    inv_mass_at,
    mark_touched,
    motion_of,
    shared_mobility,
    shift_point,
)
from taichi_soft.core.math.finite import is_finite
from taichi_soft.core.runtime import ti


@ti.func
def precompute_mobility(state: ti.template(), slot, p, corners):
    """Compute the inverse mass of a contact's point, and the mobilities between the corners of its
    triangle.
    """
    state.soft.slot_inv_mass[slot][0] = inv_mass_at(state, p)
    for i in ti.static(range(3)):
        for k in ti.static(range(i + 1)):
            mobility = shared_mobility(state, corners[i], corners[k])
            state.hull.slot_mobility[slot][i, k] = mobility
            state.hull.slot_mobility[slot][k, i] = mobility


@ti.func
def solve_points(state: ti.template(), soft: ti.template(), slot, p, corners, friction, h, is_first):
    """Solve one contact of hull points, as `contact_solver` does for particles.

    Returns: 1 if the point and the triangle are pressed together, else 0.
    """
    normal, weights, shares = soft.slot_normal[slot], soft.slot_weights[slot], soft.slot_shares[slot]
    face, levers, moves = soft.slot_face[slot], soft.slot_levers[slot], soft.slot_moves[slot]
    m, mobility = soft.slot_inv_mass[slot][0], state.hull.slot_mobility[slot]
    _, v = motion_of(state, p)
    v *= moves[0]
    corner_v = ti.Matrix.zero(ti.f32, 3, 3)
    for i in ti.static(range(3)):
        _, corner = motion_of(state, corners[i])
        for k in ti.static(range(3)):
            corner_v[i, k] = moves[1] * corner[k]
    impulse, corner_impulses = ti.Vector.zero(ti.f32, 3), ti.Matrix.zero(ti.f32, 3, 3)

    normal_impulse = soft.slot_normal_impulse[slot]
    normal_change = normal_impulse
    if is_first == 0:
        allowed = -ti.max(soft.slot_gap[slot], 0.0) / h
        approach = v.dot(normal) - weights.dot(corner_v @ normal)
        total = m + weights.dot(mobility @ weights)
        wanted_impulse = ti.max(normal_impulse + (allowed - approach) / ti.max(total, 1e-30), 0.0)
        normal_change = wanted_impulse - normal_impulse
        normal_impulse = wanted_impulse
        soft.slot_normal_impulse[slot] = normal_impulse
    if is_finite(normal_change * normal):
        given = -normal_change * weights.outer_product(normal)
        impulse += normal_change * normal
        corner_impulses += given
        v += m * normal_change * normal
        corner_v += mobility @ given

    friction_impulse = soft.slot_friction_impulse[slot]
    if normal_impulse > 0.0 or ti.abs(friction_impulse).max() > 0.0:
        change = friction_impulse
        if is_first == 0:
            relative = v - corner_v.transpose() @ shares + levers.transpose() @ (corner_v @ face)
            sliding = relative - relative.dot(normal) * normal
            tilt = levers @ (sliding / ti.max(sliding.norm(), 1e-30))
            total = m + shares.dot(mobility @ shares) + tilt.dot(mobility @ tilt)
            wanted = friction_impulse - sliding / ti.max(total, 1e-30)
            wanted *= ti.min(1.0, friction * normal_impulse / ti.max(wanted.norm(), 1e-30))
            soft.slot_friction_impulse[slot] = wanted
            change = wanted - friction_impulse
        if is_finite(change):
            impulse += change
            corner_impulses -= shares.outer_product(change) - (levers @ change).outer_product(face)

    apply_point_impulse(state, p, impulse)
    for i in ti.static(range(3)):
        on_corner = ti.Vector([corner_impulses[i, 0], corner_impulses[i, 1], corner_impulses[i, 2]])
        apply_point_impulse(state, corners[i], on_corner)
    return int(normal_impulse > 0.0)


@ti.func
def separate_points(state: ti.template(), p, corners, slot, distance):
    """Move a point and a triangle apart by `distance` [m], without changing velocities."""
    normal, weights = state.soft.slot_normal[slot], state.soft.slot_weights[slot]
    total = state.soft.slot_inv_mass[slot][0] + weights.dot(state.hull.slot_mobility[slot] @ weights)
    if total > 0.0:
        impulse = distance / total * normal
        shift_point(state, p, impulse)
        for i in ti.static(range(3)):
            shift_point(state, corners[i], -weights[i] * impulse)


@ti.func
def mark_points_touched(state: ti.template(), p, corners):
    """Mark the carriers of a point and of a triangle's corners as touched."""
    mark_touched(state, p)
    for i in ti.static(range(3)):
        mark_touched(state, corners[i])
