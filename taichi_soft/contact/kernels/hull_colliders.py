"""Collide hull points with colliders, by impulses on the particles that carry the points.

Many points share carriers. An impulse that stops one point therefore also changes the velocities of its
neighbours, and can throw them up. All contacts of a body are solved together, by the same method as contacts
between bodies: projected Gauss-Seidel over velocities, warm-started with the impulses of the last substep.
The solver bounds the accumulated impulse of a contact, not each increment: the sum never pulls, and friction
stays within Coulomb's cone. A sweep can therefore revert an impulse that another contact made unnecessary,
and points at rest stay at rest.

Remaining penetration is corrected by changing positions, not velocities.

Groups of fields: writes colliders, hull.
"""

from taichi_soft.bodies.kernels.rigid import is_rigid
from taichi_soft.contact.distances.floor import RESTITUTION_SPEED
from taichi_soft.contact.distances.sweep import NO_TOUCH, TOUCHING, first_touch
from taichi_soft.contact.hull_fields import TOUCHES
from taichi_soft.contact.kernels.collide import with_conveyor
from taichi_soft.contact.kernels.collider_frames import center_of, in_frame, skin_of
from taichi_soft.contact.kernels.hull_points import (
    apply_point_impulse,
    inv_mass_along,
    inv_mass_at,
    mark_touched,
    motion_of,
    shift_point,
)
from taichi_soft.contact.kernels.rebound import add_normal_impulse
from taichi_soft.core.math.quaternion import spun, turned
from taichi_soft.core.runtime import ti

SWEEPS = 3
"""Number of sweeps over all contacts of a body in a substep. Forward and backward sweeps alternate."""

RIGID_SWEEPS = 12
"""Number of sweeps over the contacts of a rigid body. With fewer, the impact of a face would turn the body,
because the first corner would be stopped first."""

POSITION_CORRECTION = 0.3
"""Fraction of the depth beyond `TOUCHING` that is corrected at each point in a substep. A correction also
moves neighbouring points with the same carriers."""


@ti.func
def clear_warm_start(state: ti.template(), body):
    """Clear the impulses from which the contacts of a body's hull with colliders start."""
    state.hull.touch_count[body] = 0
    for p in range(state.hull.body_points[body][0], state.hull.body_points[body][1]):
        state.hull.held_by[p] = ti.Vector.zero(ti.i32, 2)


@ti.func
def clear_warm_start_if_free(state: ti.template(), body):
    """Clear the impulses of the warm start before a step, if no collider touched the body in the last step.

    The test reads the impulses of the last step from `state.colliders.impulse`. Call this before
    `clear_contacts`, which clears that field.
    """
    felt = ti.cast(0.0, ti.f32)
    room = state.colliders.capacity.colliders
    for row in range(body * room, (body + 1) * room):
        felt = ti.max(felt, ti.abs(state.colliders.impulse[row]).max())
    if felt == 0.0:
        clear_warm_start(state, body)


@ti.func
def _record_contact(state: ti.template(), body, row, p, k, x, v, h, since):
    """Store the contact of a hull point with the near collider at index `k`, if the two can touch.

    Returns: 1 if the contact was stored, else 0.
    """
    c = state.colliders.near[body * state.colliders.capacity.colliders + k]
    a = in_frame(state, body, c, x, since)
    b = in_frame(state, body, c, x + h * v, since + h)
    # Include paths that end just in front of the surface, because impulses at neighbours can move the point
    # farther.
    part, distance, beyond, normal = first_touch(state.colliders, c, a, b, -TOUCHING, skin_of(state, body, c))
    if part < NO_TOUCH:
        after = since + h
        spin, surface = state.colliders.spin[c], state.colliders.surface[c]
        rotation = spun(state.colliders.rotation[c], spin * after)
        n = turned(rotation, normal)
        centre = center_of(state, body, c, after)
        surface_velocity = state.colliders.velocity[c] + spin.cross(x + h * v - beyond * n - centre)
        surface_velocity = with_conveyor(state, body, c, rotation, n, surface_velocity)
        approach = n.dot(surface_velocity - v)
        # Allow an approach until the point touches the surface. A point at rest is not allowed to approach.
        allowed = ti.select(distance <= TOUCHING, 0.0, ti.min((0.5 * TOUCHING - beyond) / h - approach, 0.0))
        if approach > RESTITUTION_SPEED and surface.y > 0.0:
            allowed = surface.y * approach
        state.hull.touch_point[row] = p
        state.hull.touch_collider[row] = c
        state.hull.touch_normal[row] = n
        state.hull.touch_surface[row] = surface_velocity
        state.hull.touch_allowed[row] = allowed
        state.hull.touch_beyond[row] = beyond
        held_by, held = state.hull.held_by[p], state.hull.held_normal_impulse[p]
        normal_impulse, friction_impulse = ti.cast(0.0, ti.f32), ti.Vector.zero(ti.f32, 3)
        if held_by[0] == c + 1:
            normal_impulse, friction_impulse = held[0], state.hull.held_friction_impulse[p]
        elif held_by[1] == c + 1:
            normal_impulse, friction_impulse = held[1], state.hull.held_second_friction_impulse[p]
        state.hull.touch_normal_impulse[row] = normal_impulse
        state.hull.touch_friction_impulse[row] = friction_impulse
    return int(part < NO_TOUCH)


@ti.func
def _list_touches(state: ti.template(), body, h, since, travelled):
    """List the contacts of a body's hull points with colliders. Returns: the number of contacts."""
    first = state.touching.body_outer[body][0] * TOUCHES
    count = 0
    for p in range(state.hull.body_points[body][0], state.hull.body_points[body][1]):
        before = count
        if not (state.colliders.particle_clearance[p] > travelled):
            inv_mass = inv_mass_at(state, p)
            if inv_mass > 0.0:
                x, v = motion_of(state, p)
                for k in range(state.colliders.near_count[body]):
                    if count - before < TOUCHES:
                        count += _record_contact(state, body, first + count, p, k, x, v, h, since)
                for row in range(first + before, first + count):
                    state.hull.touch_inv_mass[row] = inv_mass
                    state.hull.touch_start[row] = x
                    state.hull.touch_start_velocity[row] = v
        state.hull.held_by[p] = ti.Vector.zero(ti.i32, 2)
    return count


@ti.func
def _solve_touch(state: ti.template(), row):
    """Solve the contact in `row` for one sweep."""
    p, n = state.hull.touch_point[row], state.hull.touch_normal[row]
    m, friction = (
        state.hull.touch_inv_mass[row],
        state.colliders.surface[state.hull.touch_collider[row]].x,
    )
    _, v = motion_of(state, p)
    relative = v - state.hull.touch_surface[row]
    along = relative.dot(n)
    sliding = relative - along * n
    normal_mass = inv_mass_along(state, p, m, n)
    friction_mass = inv_mass_along(state, p, m, sliding / ti.max(sliding.norm(), 1e-30))
    normal_impulse, friction_impulse = (
        state.hull.touch_normal_impulse[row],
        state.hull.touch_friction_impulse[row],
    )
    wanted = ti.max(normal_impulse + (state.hull.touch_allowed[row] - along) / normal_mass, 0.0)
    wanted_friction = friction_impulse - friction_impulse.dot(n) * n - sliding / friction_mass
    wanted_friction *= ti.min(1.0, friction * wanted / ti.max(wanted_friction.norm(), 1e-30))
    state.hull.touch_normal_impulse[row] = wanted
    state.hull.touch_friction_impulse[row] = wanted_friction
    apply_point_impulse(state, p, (wanted - normal_impulse) * n + wanted_friction - friction_impulse)


@ti.func
def _correct_penetration(state: ti.template(), row, h):
    """Move a hull point out of a collider, if the point would be inside after the drift.

    Returns: the angular momentum that the correction adds to the body [N m s].
    """
    p, n = state.hull.touch_point[row], state.hull.touch_normal[row]
    x, v = motion_of(state, p)
    displacement = x - state.hull.touch_start[row] + h * (v - state.hull.touch_start_velocity[row])
    depth = -(state.hull.touch_beyond[row] + displacement.dot(n)) - TOUCHING
    shift = ti.Vector.zero(ti.f32, 3)
    if depth > 0.0:
        inv_mass = inv_mass_along(state, p, state.hull.touch_inv_mass[row], n)
        shift = POSITION_CORRECTION * depth / inv_mass * n
        shift_point(state, p, shift)
    return shift.cross(v)


@ti.func
def _store_impulse(state: ti.template(), body, row, turn, time):
    """Add the impulse of a contact to the impulses on its collider, and store it for the next substep.

    Args:
        turn: angular momentum that `_correct_penetration` added to the body [N m s].
        time: time from the start of the step to the impulse [s].
    """
    p, c, n = state.hull.touch_point[row], state.hull.touch_collider[row], state.hull.touch_normal[row]
    pair = body * state.colliders.capacity.colliders + c
    normal_impulse, friction_impulse = (
        state.hull.touch_normal_impulse[row],
        state.hull.touch_friction_impulse[row],
    )
    state.colliders.angular_impulse[pair] = state.colliders.angular_impulse[pair] - turn
    if normal_impulse > 0.0:
        impulse = -normal_impulse * n - friction_impulse
        centre = center_of(state, body, c, time)
        angular_impulse = (state.hull.touch_start[row] - centre).cross(impulse)
        state.colliders.impulse[pair] = state.colliders.impulse[pair] + impulse
        state.colliders.angular_impulse[pair] = state.colliders.angular_impulse[pair] + angular_impulse
        if state.colliders.surface[c].y >= 0.0:
            before = n.dot(state.hull.touch_start_velocity[row])
            surface = n.dot(state.hull.touch_surface[row])
            add_normal_impulse(state.colliders, pair, normal_impulse, n, before, surface)
        mark_touched(state, p)
        held_by = state.hull.held_by[p]
        if held_by[0] == 0:
            state.hull.held_by[p][0] = c + 1
            state.hull.held_normal_impulse[p][0] = normal_impulse
            state.hull.held_friction_impulse[p] = friction_impulse
        elif held_by[1] == 0:
            state.hull.held_by[p][1] = c + 1
            state.hull.held_normal_impulse[p][1] = normal_impulse
            state.hull.held_second_friction_impulse[p] = friction_impulse


@ti.real_func
def begin_touches(state: ti.template(), body: ti.i32, h: ti.f32, since: ti.f32, travelled: ti.f32):
    """List the contacts of a body's hull with colliders, and repeat their impulses of the last substep.

    Call this after the kick. Contact between bodies can then solve both kinds of contacts together.
    """
    first = state.touching.body_outer[body][0] * TOUCHES
    count = _list_touches(state, body, h, since, travelled)
    for row in range(first, first + count):
        n, normal_impulse = state.hull.touch_normal[row], state.hull.touch_normal_impulse[row]
        if normal_impulse > 0.0:
            impulse = normal_impulse * n + state.hull.touch_friction_impulse[row]
            apply_point_impulse(state, state.hull.touch_point[row], impulse)
    state.hull.touch_count[body] = count


@ti.func
def solve_touches(state: ti.template(), body, is_backward):
    """Solve the contacts of a body's hull with colliders for one sweep."""
    first, count = state.touching.body_outer[body][0] * TOUCHES, state.hull.touch_count[body]
    for i in range(count):
        _solve_touch(state, first + ti.select(is_backward == 1, count - 1 - i, i))


@ti.real_func
def collide_points(state: ti.template(), body: ti.i32, h: ti.f32, since: ti.f32, travelled: ti.f32):
    """Solve the contacts of a body's hull with colliders. Call this before the drift of the body."""
    if state.hull.touch_count[body] == 0:
        begin_touches(state, body, h, since, travelled)
    first, count = state.touching.body_outer[body][0] * TOUCHES, state.hull.touch_count[body]
    state.hull.touch_count[body] = 0
    sweeps = ti.select(is_rigid(state, body), RIGID_SWEEPS, SWEEPS)
    for sweep in range(sweeps):
        for i in range(count):
            _solve_touch(state, first + ti.select(sweep % 2 == 0, i, count - 1 - i))
    for row in range(first, first + count):
        turn = _correct_penetration(state, row, h)
        _store_impulse(state, body, row, turn, since + h)
