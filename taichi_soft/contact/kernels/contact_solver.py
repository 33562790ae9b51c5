"""Contact solver for the bodies of an island: apply impulses between four points, contact by contact.

The normal impulse removes the part of a contact's approach that would close its gap within the substep.
Friction reduces the sliding. The method is projected Gauss-Seidel over velocities, warm-started with the
impulses of the last substep. The impulses of a contact are equal and opposite. Penetration is corrected by
changing positions, not velocities.

Groups of fields: reads hull, islands; writes soft.
"""

from taichi_soft.bodies.kernels.particles import inv_mass_of, moves
from taichi_soft.bodies.kernels.rigid import is_rigid
from taichi_soft.contact.kernels.features import first_slot_of
from taichi_soft.contact.kernels.hull_colliders import solve_touches
from taichi_soft.contact.kernels.hull_points import (
    apply_point_impulse,
    mark_touched,
    motion_of,
    precompute_mobility,
    shift_point,
)
from taichi_soft.contact.kernels.rigid_contacts import separate_rigid, solve_rigid_contact
from taichi_soft.core.math.finite import is_finite
from taichi_soft.core.runtime import ti

SWEEPS = 3
"""Number of sweeps over all contacts in a substep. Because of the warm start, eight sweeps do not make heaps
calmer."""

RIGID_SWEEPS = 10
"""Number of sweeps in an island with rigid bodies, in which impulses must pass through stacks."""

POSITION_CORRECTION, SHORT_STEP = 0.2, 1.0 / 400.0
"""Fraction of a penetration that is corrected in each substep, and substep [s] below which this fraction
falls with the cube of the substep. A correction does work against the forces that press two bodies together:
with the whole fraction in short substeps, a ball on a taut sheet gained ten times its energy."""

SLOW_CORRECTION = 0.2
"""Time [s] to correct a penetration as deep as the thickness. Slower corrections fall only with the substep,
not with its cube: they do little work, and keep layers of thin cloth at their thickness."""

CONTACT_SLOP = 0.25
"""Penetration, relative to the thickness, that is not corrected. Pairs at rest stay below this limit.
Correcting the whole depth would act against the forces that press the pair together, and excite
vibrations."""


@ti.func
def precompute_masses(state: ti.template(), slot):
    """Compute the inverse masses of a contact's points, which stay constant during the solver's sweeps."""
    points = state.soft.slot_points[slot]
    for i in ti.static(range(4)):
        state.soft.slot_inv_mass[slot][i] = inv_mass_of(state, points[i])
        state.soft.slot_moves[slot][i] = moves(state, points[i])
    if ti.static(state.capacity.contact.hull):
        precompute_mobility(state, slot, points)


@ti.func
def _response(state: ti.template(), slot, impulses):
    """Return the changes of velocity of a contact's points [m/s] by impulses on them, (4, 3) [N s]."""
    changes = ti.Matrix.zero(ti.f32, 4, 3)
    if ti.static(state.capacity.contact.hull):
        changes = state.hull.slot_mobility[slot] @ impulses
    else:
        inv_mass = state.soft.slot_inv_mass[slot]
        for i in ti.static(range(4)):
            for k in ti.static(range(3)):
                changes[i, k] = inv_mass[i] * impulses[i, k]
    return changes


@ti.func
def _compliance(state: ti.template(), slot, weights):
    """Return the relative speed that a unit impulse with these weights of the points causes [m/s]."""
    response = weights * state.soft.slot_inv_mass[slot]
    if ti.static(state.capacity.contact.hull):
        response = state.hull.slot_mobility[slot] @ weights
    return weights.dot(response)


@ti.func
def _separate(state: ti.template(), slot, distance):
    """Move the points of a contact apart by `distance` [m]. Velocities do not change."""
    points, weights = state.soft.slot_points[slot], state.soft.slot_weights[slot]
    total = _compliance(state, slot, weights)
    if total > 0.0:
        impulse = distance / total * state.soft.slot_normal[slot]
        for i in ti.static(range(4)):
            p = points[i]
            if ti.static(state.capacity.contact.hull):
                shift_point(state, p, weights[i] * impulse)
            else:
                shift = weights[i] * state.soft.slot_inv_mass[slot][i] * impulse
                state.particle_position[p] = state.particle_position[p] + shift


@ti.func
def _velocities(state: ti.template(), slot):
    """Return the velocities of a contact's points, (4, 3) [m/s]; zero for bodies that do not move."""
    points, moves_now = state.soft.slot_points[slot], state.soft.slot_moves[slot]
    velocities = ti.Matrix.zero(ti.f32, 4, 3)
    for i in ti.static(range(4)):
        v = state.particle_velocity[points[i]]
        if ti.static(state.capacity.contact.hull):
            _, v = motion_of(state, points[i])
        for k in ti.static(range(3)):
            velocities[i, k] = moves_now[i] * v[k]
    return velocities


@ti.func
def _apply(state: ti.template(), slot, velocities, impulses):
    """Store new velocities of a contact's points, or apply the impulses to the carriers of hull points."""
    points = state.soft.slot_points[slot]
    for i in ti.static(range(4)):
        if ti.static(state.capacity.contact.hull):
            impulse = ti.Vector([impulses[i, 0], impulses[i, 1], impulses[i, 2]])
            apply_point_impulse(state, points[i], impulse)
        elif state.soft.slot_moves[slot][i] > 0.0:
            for k in ti.static(range(3)):
                state.particle_velocity[points[i]][k] = velocities[i, k]


@ti.func
def _solve_contact(state: ti.template(), soft: ti.template(), slot, friction, h, is_first):
    """Apply a normal impulse and friction between the points of a contact.

    The normal impulse removes any approach that would close the gap within `h` [s]. The first sweep repeats
    the impulses of the last substep.

    Returns: 1 if the two sides are pressed together, else 0.
    """
    normal, weights, v = soft.slot_normal[slot], soft.slot_weights[slot], _velocities(state, slot)
    total_impulses = ti.Matrix.zero(ti.f32, 4, 3)

    normal_impulse = soft.slot_normal_impulse[slot]
    change = normal_impulse
    if is_first == 0:
        allowed = -ti.max(soft.slot_gap[slot], 0.0) / h
        approach = weights.dot(v @ normal)
        total = _compliance(state, slot, weights)
        wanted = ti.max(normal_impulse + (allowed - approach) / ti.max(total, 1e-30), 0.0)
        change = wanted - normal_impulse
        if is_finite(change * normal):
            normal_impulse = wanted
            soft.slot_normal_impulse[slot] = normal_impulse
    if is_finite(change * normal):
        impulses = (change * weights).outer_product(normal)
        v += _response(state, slot, impulses)
        total_impulses += impulses

    friction_impulse = soft.slot_friction_impulse[slot]
    # If the normal impulse is zero again, revert the friction of earlier sweeps.
    if normal_impulse > 0.0 or ti.abs(friction_impulse).max() > 0.0:
        shares, levers, axis = soft.slot_shares[slot], soft.slot_levers[slot], soft.slot_axis[slot]
        friction_change = friction_impulse
        if is_first == 0:
            relative = v.transpose() @ shares - levers.transpose() @ (v @ axis)
            sliding = relative - relative.dot(normal) * normal
            tilt = levers @ (sliding / ti.max(sliding.norm(), 1e-30))
            total = _compliance(state, slot, shares) + _compliance(state, slot, tilt)
            wanted = friction_impulse - sliding / ti.max(total, 1e-30)
            wanted *= ti.min(1.0, friction * normal_impulse / ti.max(wanted.norm(), 1e-30))
            friction_change = wanted - friction_impulse
            if is_finite(friction_change):  # what is not finite could not be restored from a snapshot
                soft.slot_friction_impulse[slot] = wanted
        if is_finite(friction_change):
            impulses = shares.outer_product(friction_change)
            impulses -= (levers @ friction_change).outer_product(axis)
            v += _response(state, slot, impulses)
            total_impulses += impulses

    _apply(state, slot, v, total_impulses)
    return int(normal_impulse > 0.0)


@ti.func
def _solve_slot(state: ti.template(), slot, h, sweep, last):
    """Solve one contact in one sweep. In the sweep `last`, also correct its penetration."""
    points = state.soft.slot_points[slot]
    body, other = state.particle_body[points[0]], state.particle_body[points[3]]
    mine, theirs = state.body_surface[body], state.body_surface[other]
    friction, is_pressed = ti.sqrt(mine.x * theirs.x), 0
    thickness = 0.5 * (mine.y + theirs.y)
    depth = -state.soft.slot_gap[slot] - CONTACT_SLOP * thickness
    shortness = ti.min(1.0, h / SHORT_STEP)
    correction = POSITION_CORRECTION * shortness * depth
    slow = h / SLOW_CORRECTION * thickness
    correction = ti.max(ti.min(correction, slow), shortness * shortness * correction)
    is_stiff = False
    if ti.static(state.capacity.contact.rigid):
        is_stiff = is_rigid(state, body) or is_rigid(state, other)
        if is_stiff:
            is_pressed = solve_rigid_contact(state, slot, friction, h, int(sweep == 0))
            if sweep == last and depth > 0.0:
                separate_rigid(state, slot, correction)
    if not is_stiff:
        is_pressed = _solve_contact(state, state.soft, slot, friction, h, int(sweep == 0))
        if sweep == last and depth > 0.0:
            _separate(state, slot, correction)
    if is_pressed == 1:
        for i in ti.static(range(4)):
            mark_touched(state, points[i])


@ti.real_func
def solve_island(state: ti.template(), island: ti.i32, h: ti.f32):
    """Solve the contacts of an island for a substep of `h` [s]."""
    first, end = state.islands.first[island], state.islands.first[island + 1]
    last = SWEEPS
    if ti.static(state.capacity.contact.rigid):
        for i in range(first, end):
            last = ti.select(is_rigid(state, state.islands.body[i]), RIGID_SWEEPS, last)
    for sweep in range(last + 1):
        for i in range(first, end):
            body = state.islands.body[i]
            row = first_slot_of(state, body)
            for k in range(row, row + state.soft.contact_count[body]):
                _solve_slot(state, state.soft.contact_slot[k], h, sweep, last)
            if ti.static(state.capacity.contact.rigid):
                if sweep > 0 and is_rigid(state, body):
                    solve_touches(state, body, sweep % 2)
