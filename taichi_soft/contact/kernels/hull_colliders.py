"""Points of hulls against colliders: impulses on the particles that carry them.

Many points hang on the same particles. What one of them takes to stop stops its neighbours too, and may throw
them up. So the contacts of a body are solved together, as those of bodies are with each other: projected
Gauss-Seidel over velocities, begun with the impulses of the substep before. The sum of a contact's impulses
is bounded, no single one: it never pulls, and friction stays within Coulomb's cone. Each sweep may take back
what another contact made superfluous. What rests then has the impulses that bear it, and stands still.

What is within a collider all the same is moved out without giving it a velocity.
"""

from taichi_soft.contact.distances.floor import RESTITUTION_SPEED
from taichi_soft.contact.distances.sweep import NEVER, TOUCHING, first_touch
from taichi_soft.contact.hull_fields import TOUCHES
from taichi_soft.contact.kernels.collide import in_frame
from taichi_soft.contact.kernels.hull import inv_mass_at, mark_touched, motion_of, push_point, shift_point
from taichi_soft.contact.kernels.rebound import add_normal_impulse
from taichi_soft.core.math.quaternion import spun, turned
from taichi_soft.core.runtime import ti

SWEEPS = 3
"""Times all contacts of a body are gone through in a substep, there and back in turn."""

PUSH_OUT = 0.3
"""Part of a depth beyond `TOUCHING` that a substep takes back, at each point: its neighbours, which hang on
the same particles, go with it."""


@ti.func
def forget_held(state: ti.template(), body):
    """Let the contacts of a hull with colliders begin anew."""
    for p in range(state.hull.body_points[body][0], state.hull.body_points[body][1]):
        state.hull.held_by[p] = ti.Vector.zero(ti.i32, 2)


@ti.func
def forget_held_if_free(state: ti.template(), body):
    """The same before a step, if nothing touched the body in the last one, whose impulses are still there."""
    felt = ti.cast(0.0, ti.f32)
    for row in range(body * state.contact.capacity.colliders, (body + 1) * state.contact.capacity.colliders):
        felt = ti.max(felt, ti.abs(state.contact.impulse[row]).max())
    if felt == 0.0:
        forget_held(state, body)


@ti.func
def _note_touch(state: ti.template(), body, row, p, k, x, v, h, since):
    """Write down how a point meets the collider at place `k` of those near, if it does (1)."""
    c = state.contact.near[body * state.contact.capacity.colliders + k]
    a = in_frame(state.contact, c, x, since)
    b = in_frame(state.contact, c, x + h * v, since + h)
    # What ends a little in front is listed, too: its neighbours may take it there.
    part, distance, beyond, normal = first_touch(state.contact, c, a, b, -TOUCHING)
    if part < NEVER:
        after = since + h
        spin, surface = state.contact.collider_spin[c], state.contact.collider_surface[c]
        n = turned(spun(state.contact.collider_rotation[c], spin * after), normal)
        centre = state.contact.collider_position[c] + state.contact.collider_velocity[c] * after
        surface_velocity = state.contact.collider_velocity[c] + spin.cross(x + h * v - beyond * n - centre)
        approach = n.dot(surface_velocity - v)
        # Up to the surface; what rests on it stays where it is.
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
    return int(part < NEVER)


@ti.func
def _list_touches(state: ti.template(), body, h, since, gone):
    """List the contacts of a body's points with colliders. Returns: how many there are."""
    first = state.touching.body_outer[body][0] * TOUCHES
    count = 0
    for p in range(state.hull.body_points[body][0], state.hull.body_points[body][1]):
        before = count
        if not (state.contact.particle_clearance[p] > gone):
            inv_mass = inv_mass_at(state, p)
            if inv_mass > 0.0:
                x, v = motion_of(state, p)
                for k in range(state.contact.near_count[body]):
                    if count - before < TOUCHES:
                        count += _note_touch(state, body, first + count, p, k, x, v, h, since)
                for row in range(first + before, first + count):
                    state.hull.touch_inv_mass[row] = inv_mass
                    state.hull.touch_start[row] = x
                    state.hull.touch_start_velocity[row] = v
        state.hull.held_by[p] = ti.Vector.zero(ti.i32, 2)
    return count


@ti.func
def _solve_touch(state: ti.template(), row):
    """One contact in one sweep."""
    p, n = state.hull.touch_point[row], state.hull.touch_normal[row]
    m, friction = (
        state.hull.touch_inv_mass[row],
        state.contact.collider_surface[state.hull.touch_collider[row]].x,
    )
    _, v = motion_of(state, p)
    relative = v - state.hull.touch_surface[row]
    along = relative.dot(n)
    normal_impulse, friction_impulse = (
        state.hull.touch_normal_impulse[row],
        state.hull.touch_friction_impulse[row],
    )
    wanted = ti.max(normal_impulse + (state.hull.touch_allowed[row] - along) / m, 0.0)
    wanted_friction = friction_impulse - friction_impulse.dot(n) * n - (relative - along * n) / m
    wanted_friction *= ti.min(1.0, friction * wanted / ti.max(wanted_friction.norm(), 1e-30))
    state.hull.touch_normal_impulse[row] = wanted
    state.hull.touch_friction_impulse[row] = wanted_friction
    push_point(state, p, (wanted - normal_impulse) * n + wanted_friction - friction_impulse)


@ti.func
def _push_out(state: ti.template(), row, h):
    """Move a point that will be within a collider after the drift a part of the way out of it.

    Returns: what that gives its body of angular momentum [N m s].
    """
    p, n = state.hull.touch_point[row], state.hull.touch_normal[row]
    x, v = motion_of(state, p)
    way = x - state.hull.touch_start[row] + h * (v - state.hull.touch_start_velocity[row])
    depth = -(state.hull.touch_beyond[row] + way.dot(n)) - TOUCHING
    shift = ti.Vector.zero(ti.f32, 3)
    if depth > 0.0:
        shift = PUSH_OUT * depth / state.hull.touch_inv_mass[row] * n
        shift_point(state, p, shift)
    return shift.cross(v)


@ti.func
def _note_impulse(state: ti.template(), body, row, turn, time):
    """Tell the collider what it was given, and remember it for the next substep.

    Args:
        turn: what moving the point out gave its body of angular momentum [N m s].
        time: since the start of the step, to which the impulse belongs [s].
    """
    p, c, n = state.hull.touch_point[row], state.hull.touch_collider[row], state.hull.touch_normal[row]
    pair = body * state.contact.capacity.colliders + c
    normal_impulse, friction_impulse = (
        state.hull.touch_normal_impulse[row],
        state.hull.touch_friction_impulse[row],
    )
    state.contact.angular_impulse[pair] = state.contact.angular_impulse[pair] - turn
    if normal_impulse > 0.0:
        impulse = -normal_impulse * n - friction_impulse
        centre = state.contact.collider_position[c] + state.contact.collider_velocity[c] * time
        angular_impulse = (state.hull.touch_start[row] - centre).cross(impulse)
        state.contact.impulse[pair] = state.contact.impulse[pair] + impulse
        state.contact.angular_impulse[pair] = state.contact.angular_impulse[pair] + angular_impulse
        if state.contact.collider_surface[c].y >= 0.0:
            before = n.dot(state.hull.touch_start_velocity[row])
            surface = n.dot(state.hull.touch_surface[row])
            add_normal_impulse(state.contact, pair, normal_impulse, n, before, surface)
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
def collide_points(state: ti.template(), body: ti.i32, h: ti.f32, since: ti.f32, gone: ti.f32):
    """What colliders make of the velocities and places of a body whose hull meets them, before it drifts."""
    first = state.touching.body_outer[body][0] * TOUCHES
    count = _list_touches(state, body, h, since, gone)
    for row in range(first, first + count):
        n, normal_impulse = state.hull.touch_normal[row], state.hull.touch_normal_impulse[row]
        if normal_impulse > 0.0:
            impulse = normal_impulse * n + state.hull.touch_friction_impulse[row]
            push_point(state, state.hull.touch_point[row], impulse)
    for sweep in range(SWEEPS):
        for i in range(count):
            _solve_touch(state, first + ti.select(sweep % 2 == 0, i, count - 1 - i))
    for row in range(first, first + count):
        turn = _push_out(state, row, h)
        _note_impulse(state, body, row, turn, since + h)
