"""Contact solver for the bodies of an island: apply impulses between a vertex and a triangle, pair by pair.

The normal impulse removes the part of a pair's approach that would close its gap within the substep. Friction
reduces the sliding of the pair. The method is projected Gauss-Seidel over velocities, warm-started with the
impulses of the last substep. Impulses are equal and opposite. Penetration is corrected by changing positions,
not velocities.

Groups of fields: reads hull, islands; writes soft.
"""

from taichi_soft.bodies.kernels.particles import inv_mass_of, moves
from taichi_soft.contact.fields import SLOTS
from taichi_soft.contact.kernels.hull_solver import (
    mark_points_touched,
    precompute_mobility,
    separate_points,
    solve_points,
)
from taichi_soft.core.math.finite import is_finite
from taichi_soft.core.runtime import ti

SWEEPS = 3
"""Number of sweeps over all contacts in a substep. Because of the warm start, eight sweeps do not make heaps
calmer."""

POSITION_CORRECTION = 0.2
"""Fraction of a penetration that is corrected in each substep."""

CONTACT_SLOP = 0.25
"""Penetration, relative to the thickness, that is not corrected. Pairs at rest stay below this limit.
Correcting the whole depth would act against the forces that press the pair together, and excite
vibrations."""


@ti.func
def precompute_contact(state: ti.template(), slot):
    """Compute the terms of a contact that stay constant during the solver's sweeps.

    Friction acts at the vertex, as if the triangle extended to the vertex. The velocity of the triangle there
    is sum b v - s sum g (n.v), as in a rigid rotation. The symbols are the barycentric coordinates b of the
    vertex, their gradients g, the velocities v of the corners, the normal n of the triangle and the height s
    of the vertex above the triangle. Distributing the impulse in the same proportions conserves the angular
    momentum of the pair at any distance.
    """
    p, corners = state.soft.slot_vertices[slot].x, state.soft.slot_vertices[slot].yzw
    a, b, c = (
        state.particle_position[corners[0]],
        state.particle_position[corners[1]],
        state.particle_position[corners[2]],
    )
    weights = state.soft.slot_weights[slot]
    face = (b - a).cross(c - a)
    area2 = ti.max(face.norm(), 1e-30)
    n = face / area2
    separation = state.particle_position[p] - weights.x * a - weights.y * b - weights.z * c
    gradients = ti.Matrix.rows([n.cross(c - b) / area2, n.cross(a - c) / area2, n.cross(b - a) / area2])
    state.soft.slot_face[slot] = n
    state.soft.slot_shares[slot] = weights + gradients @ separation
    state.soft.slot_levers[slot] = separation.dot(n) * gradients
    state.soft.slot_inv_mass[slot] = ti.Vector(
        [
            inv_mass_of(state, p),
            inv_mass_of(state, corners[0]),
            inv_mass_of(state, corners[1]),
            inv_mass_of(state, corners[2]),
        ]
    )
    state.soft.slot_moves[slot] = ti.Vector([moves(state, p), moves(state, corners[0])])
    if ti.static(state.capacity.contact.hull):
        precompute_mobility(state, slot, p, corners)


@ti.func
def _separate(state: ti.template(), p, corners, slot, depth):
    """Move a pair apart by a fraction of its penetration `depth` [m], without changing velocities."""
    normal, weights = state.soft.slot_normal[slot], state.soft.slot_weights[slot]
    total = inv_mass_of(state, p)
    for i in range(3):
        total += weights[i] * weights[i] * inv_mass_of(state, corners[i])
    if total > 0.0:
        impulse = POSITION_CORRECTION * depth / total
        state.particle_position[p] = state.particle_position[p] + inv_mass_of(state, p) * impulse * normal
        for i in range(3):
            q = corners[i]
            back = weights[i] * inv_mass_of(state, q) * impulse
            state.particle_position[q] = state.particle_position[q] - back * normal


@ti.func
def _solve_contact(state: ti.template(), soft: ti.template(), slot, p, corners, friction, h, is_first):
    """Apply a normal impulse and friction to a vertex and a triangle.

    The normal impulse removes any approach that would close the gap within `h` [s]. The first sweep repeats
    the impulses of the last substep.

    Returns: 1 if the vertex and the triangle are pressed together, else 0.
    """
    normal, weights, shares = soft.slot_normal[slot], soft.slot_weights[slot], soft.slot_shares[slot]
    face, levers, moves = soft.slot_face[slot], soft.slot_levers[slot], soft.slot_moves[slot]
    m, corner_m = soft.slot_inv_mass[slot][0], soft.slot_inv_mass[slot].yzw
    v = moves[0] * state.particle_velocity[p]
    corner_v = moves[1] * ti.Matrix.rows(
        [
            state.particle_velocity[corners[0]],
            state.particle_velocity[corners[1]],
            state.particle_velocity[corners[2]],
        ]
    )

    normal_impulse = soft.slot_normal_impulse[slot]
    impulse = normal_impulse
    if is_first == 0:
        allowed = -ti.max(soft.slot_gap[slot], 0.0) / h
        approach = v.dot(normal) - weights.dot(corner_v @ normal)
        total = m + (weights * weights).dot(corner_m)
        wanted_impulse = ti.max(normal_impulse + (allowed - approach) / ti.max(total, 1e-30), 0.0)
        impulse = wanted_impulse - normal_impulse
        normal_impulse = wanted_impulse
        soft.slot_normal_impulse[slot] = normal_impulse
    if is_finite(impulse * normal):
        v += m * impulse * normal
        corner_v -= (impulse * weights * corner_m).outer_product(normal)

    friction_impulse = soft.slot_friction_impulse[slot]
    # If the normal impulse is zero again, revert the friction of earlier sweeps.
    if normal_impulse > 0.0 or ti.abs(friction_impulse).max() > 0.0:
        change = friction_impulse
        if is_first == 0:
            relative = v - corner_v.transpose() @ shares + levers.transpose() @ (corner_v @ face)
            sliding = relative - relative.dot(normal) * normal
            tilt = levers @ (sliding / ti.max(sliding.norm(), 1e-30))
            total = m + corner_m.dot(shares * shares + tilt * tilt)
            wanted = friction_impulse - sliding / ti.max(total, 1e-30)
            wanted *= ti.min(1.0, friction * normal_impulse / ti.max(wanted.norm(), 1e-30))
            soft.slot_friction_impulse[slot] = wanted
            change = wanted - friction_impulse
        if is_finite(change):
            v += m * change
            taken = (corner_m * shares).outer_product(change)
            corner_v -= taken - (corner_m * (levers @ change)).outer_product(face)

    if moves[0] > 0.0:
        state.particle_velocity[p] = v
    if moves[1] > 0.0:
        for i in ti.static(range(3)):
            state.particle_velocity[corners[i]] = ti.Vector([corner_v[i, 0], corner_v[i, 1], corner_v[i, 2]])
    return int(normal_impulse > 0.0)


@ti.func
def _solve_slot(state: ti.template(), slot, h, sweep):
    """Solve one contact in one sweep. In the last sweep, also correct the penetration of the contact."""
    p, corners = state.soft.slot_vertices[slot].x, state.soft.slot_vertices[slot].yzw
    mine = state.body_surface[state.particle_body[p]]
    theirs = state.body_surface[state.particle_body[corners[0]]]
    if ti.static(state.capacity.contact.hull):
        friction = ti.sqrt(mine.x * theirs.x)
        if solve_points(state, state.soft, slot, p, corners, friction, h, int(sweep == 0)) == 1:
            mark_points_touched(state, p, corners)
    elif (
        _solve_contact(state, state.soft, slot, p, corners, ti.sqrt(mine.x * theirs.x), h, int(sweep == 0))
        == 1
    ):
        state.particle_touches[p] = 1
        for i in ti.static(range(3)):
            state.particle_touches[corners[i]] = 1
    depth = -state.soft.slot_gap[slot] - CONTACT_SLOP * 0.5 * (mine.y + theirs.y)
    if sweep == SWEEPS and depth > 0.0:
        if ti.static(state.capacity.contact.hull):
            separate_points(state, p, corners, slot, POSITION_CORRECTION * depth)
        else:
            _separate(state, p, corners, slot, depth)


@ti.real_func
def solve_island(state: ti.template(), island: ti.i32, h: ti.f32):
    """Solve the contacts of an island for a substep of `h` [s]."""
    first, last = state.islands.first[island], state.islands.first[island + 1]
    for sweep in range(SWEEPS + 1):
        for i in range(first, last):
            body = state.islands.body[i]
            row = state.touching.body_outer[body][0] * SLOTS
            for k in range(row, row + state.soft.contact_count[body]):
                _solve_slot(state, state.soft.contact_slot[k], h, sweep)
