"""Compute positions and velocities of hull points from the particles that carry them, and distribute impulses
to these particles.

In a world without hulls, each particle is its own hull point.

Groups of fields: reads joints, rigid; writes hull.
"""

from taichi_soft.bodies.kernels.particles import inv_mass_of
from taichi_soft.bodies.kernels.rigid import (
    is_rigid,
    push_rigid,
    rigid_inv_mass,
    rigid_velocity,
    shift_rigid,
)
from taichi_soft.core.runtime import ti


@ti.func
def motion_of(state: ti.template(), p):
    """Return position [m] and velocity [m/s] of a particle or a hull point."""
    x, v = state.particle_position[p], state.particle_velocity[p]
    if ti.static(state.capacity.contact.hull):
        who, weights = state.hull.carriers[p], state.hull.weights[p]
        x, v = ti.Vector.zero(ti.f32, 3), ti.Vector.zero(ti.f32, 3)
        for k in ti.static(range(4)):
            x += weights[k] * state.particle_position[who[k]]
            v += weights[k] * state.particle_velocity[who[k]]
    if ti.static(state.capacity.contact.rigid):
        if is_rigid(state, state.particle_body[p]):
            v = rigid_velocity(state, state.particle_body[p], x)
    return x, v


@ti.func
def inv_mass_at(state: ti.template(), p):
    """Return the inverse mass of a particle or hull point [1/kg]; 0 if the body cannot move."""
    inv_mass = ti.cast(0.0, ti.f32)
    if ti.static(state.capacity.contact.hull):
        who, weights = state.hull.carriers[p], state.hull.weights[p]
        for k in ti.static(range(4)):
            inv_mass += weights[k] * weights[k] * inv_mass_of(state, who[k])
        if ti.static(state.capacity.contact.rigid):
            if is_rigid(state, state.particle_body[p]):
                inv_mass = state.rigid.inv_mass[state.particle_body[p]]
    else:
        inv_mass = inv_mass_of(state, p)
    return inv_mass


@ti.func
def inv_mass_along(state: ti.template(), p, inv_mass, n):
    """Return the speed along `n` that 1 N s along `n` gives to a hull point [m/s].

    Args:
        inv_mass: result of `inv_mass_at`, which holds for every direction if the body can deform.
        n: unit vector, or zero.
    """
    found = inv_mass
    if ti.static(state.capacity.contact.rigid):
        body = state.particle_body[p]
        if is_rigid(state, body):
            x, _ = motion_of(state, p)
            found = rigid_inv_mass(state, body, x, n)
    return found


@ti.real_func
def shared_mobility(state: ti.template(), p: ti.i32, q: ti.i32) -> ti.f32:
    """Return the speed that an impulse of 1 N s at hull point `p` gives to hull point `q` of the same body
    [m/s].
    """
    mobility = ti.cast(0.0, ti.f32)
    mine, theirs = state.hull.carriers[p], state.hull.carriers[q]
    own_weights, their_weights = state.hull.weights[p], state.hull.weights[q]
    for i in range(4):
        for k in range(4):
            if mine[i] == theirs[k]:
                mobility += own_weights[i] * their_weights[k] * inv_mass_of(state, mine[i])
    return mobility


@ti.func
def apply_point_impulse(state: ti.template(), p, impulse):
    """Apply an impulse [N s] to the carriers of a hull point, except carriers that cannot move."""
    is_done = False
    if ti.static(state.capacity.contact.rigid):
        is_done = is_rigid(state, state.particle_body[p])
        if is_done:
            push_rigid(state, state.particle_body[p], motion_of(state, p)[0], impulse)
    if not is_done:
        who, weights = state.hull.carriers[p], state.hull.weights[p]
        for k in range(4):
            change = weights[k] * inv_mass_of(state, who[k]) * impulse
            state.particle_velocity[who[k]] = state.particle_velocity[who[k]] + change


@ti.func
def shift_point(state: ti.template(), p, impulse):
    """Displace the carriers of a hull point as far as an `impulse` [N s] would move them in 1 s."""
    is_done = False
    if ti.static(state.capacity.contact.rigid):
        is_done = is_rigid(state, state.particle_body[p])
        if is_done:
            shift_rigid(state, state.particle_body[p], motion_of(state, p)[0], impulse)
    if not is_done:
        who, weights = state.hull.carriers[p], state.hull.weights[p]
        for k in range(4):
            change = weights[k] * inv_mass_of(state, who[k]) * impulse
            state.particle_position[who[k]] = state.particle_position[who[k]] + change


@ti.func
def mark_touched(state: ti.template(), p):
    """Mark a particle, or the carriers of a hull point, as touched."""
    if ti.static(state.capacity.contact.hull):
        who, weights = state.hull.carriers[p], state.hull.weights[p]
        for k in range(4):
            if weights[k] != 0.0:
                state.particle_touches[who[k]] = 1
    else:
        state.particle_touches[p] = 1


@ti.func
def is_held(state: ti.template(), p):
    """1 if a particle, or a carrier of a hull point, is in a joint."""
    held = 0
    if ti.static(state.capacity.contact.hull):
        who, weights = state.hull.carriers[p], state.hull.weights[p]
        for k in range(4):
            if weights[k] != 0.0:
                held = held | state.joints.is_held[who[k]]
    else:
        held = state.joints.is_held[p]
    return held


@ti.func
def has_hull(state: ti.template(), body):
    """True if a body has a hull, which is then its contact surface."""
    points = state.hull.body_points[body]
    return points[0] < points[1]


@ti.func
def place_points(state: ti.template(), body):
    """Update the positions of a body's hull points from their carriers."""
    if ti.static(state.capacity.contact.hull):
        for p in range(state.hull.body_points[body][0], state.hull.body_points[body][1]):
            x, _ = motion_of(state, p)
            state.particle_position[p] = x


@ti.func
def update_points(state: ti.template(), body, common):
    """Update the positions and speeds of a body's hull points from their carriers.

    Returns: the highest speed [m/s]; the highest speed relative to the `common` velocity [m/s].
    """
    speed, beside = ti.cast(0.0, ti.f32), ti.cast(0.0, ti.f32)
    if ti.static(state.capacity.contact.hull):
        for p in range(state.hull.body_points[body][0], state.hull.body_points[body][1]):
            x, v = motion_of(state, p)
            own = (v - common).norm()
            state.particle_position[p] = x
            if ti.static(state.capacity.contact.soft):
                state.particle_speed[p] = own
            speed, beside = ti.max(speed, v.norm()), ti.max(beside, own)
    return speed, beside


@ti.func
def precompute_mobility(state: ti.template(), slot, points):
    """Compute the mobilities between the four points of a contact.

    Points of the same body can share carriers. An impulse at one point then also moves the others. The
    mobility of a rigid body depends on the direction, so it is not included.
    """
    for i in ti.static(range(4)):
        for k in ti.static(range(i + 1)):
            mobility = ti.cast(0.0, ti.f32)
            if not is_rigid(state, state.particle_body[points[i]]):
                mobility = shared_mobility(state, points[i], points[k])
            state.hull.slot_mobility[slot][i, k] = mobility
            state.hull.slot_mobility[slot][k, i] = mobility
