"""Restitution of a whole body: limit the speed at which its centre of mass leaves a collider.

An elastic body stores the energy of an impact and returns it, independently of the contact law for vertices.
Newton's law of restitution is therefore applied to the centre of mass: a body that approaches a collider at
speed v leaves the collider at speed e v. The same change of velocity for all particles removes the excess
speed. The change is limited to the velocity that contact has added, because a collider does not pull.

Groups of fields: writes colliders.
"""

from taichi_soft.contact.distances.floor import RESTITUTION_SPEED
from taichi_soft.contact.kernels.collider_frames import start_of
from taichi_soft.core.constants import LANES, ROW_BITS
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti

MIN_REBOUND = 0.1
"""Smallest limit for the speed of the centre of mass [m/s]. This speed lets a flattened body rise again."""


@ti.func
def begin_rebounds(state: ti.template(), body):
    """Reset the rebound speeds of a body's contacts that ended.

    Call this before the impulses of the last step are cleared.
    """
    row = body * state.colliders.capacity.colliders
    while row < (body + 1) * state.colliders.capacity.colliders:
        lasts = ti.abs(state.colliders.impulse[row]).max() > 0.0
        leave = ti.select(lasts, state.colliders.rebound[row], 0.0)
        state.colliders.rebound[row] = leave
        state.colliders.prev_rebound[row] = leave
        row = row_behind(row)


@ti.func
def restore_rebounds(state: ti.template(), body):
    """Restore the rebound speeds of a body before its step is retried."""
    row = body * state.colliders.capacity.colliders
    while row < (body + 1) * state.colliders.capacity.colliders:
        state.colliders.rebound[row] = state.colliders.prev_rebound[row]
        row = row_behind(row)


@ti.func
def add_normal_impulse(colliders: ti.template(), row, normal_impulse, normal, before, surface):
    """Add the normal impulse of a collider on a particle to the sums that `limit_rebounds` uses.

    Args:
        normal_impulse: impulse along the normal [N s].
        before: velocity of the particle along the normal before the impulse [m/s].
        surface: velocity of the surface along the normal [m/s].
    """
    colliders.normal_impulse[row] = colliders.normal_impulse[row] + normal_impulse * normal
    rates = ti.Vector([normal_impulse, normal_impulse * surface, normal_impulse * (surface - before)])
    colliders.normal_impulse_rates[row] = colliders.normal_impulse_rates[row] + rates


@ti.func
def _momentum_along(state: ti.template(), first, end, n):
    """Return mass [kg] and momentum along `n` [kg m/s] of the particles that are not pinned."""
    masses, momenta = ti.Vector.zero(ti.f32, LANES), ti.Vector.zero(ti.f32, LANES)
    for block in range((end - first + LANES - 1) // LANES):
        row = (first + block * LANES) & ROW_BITS
        for lane in range(LANES):
            counts = row + lane < end and state.particle_inv_mass[row + lane] > 0.0
            mass = ti.select(counts, state.particle_mass[row + lane], 0.0)
            masses[lane] += mass
            momenta[lane] += mass * state.particle_velocity[row + lane].dot(n)
    return masses.sum(), momenta.sum()


@ti.func
def limit_rebounds(state: ti.template(), body, time):
    """Limit the speed at which the centre of mass leaves each collider, after the collisions of a substep.

    Args:
        time: time since the start of the fixed step [s].
    """
    particles = state.body_particles[body]
    first = body * state.colliders.capacity.colliders
    for k in range(state.colliders.near_count[body]):
        c = state.colliders.near[first + k]
        row = first + c
        rates = state.colliders.normal_impulse_rates[row]
        normal_impulse = state.colliders.normal_impulse[row].norm()
        if normal_impulse > 0.0:
            n = state.colliders.normal_impulse[row] / normal_impulse
            mass, along = _momentum_along(state, particles[0], particles[1], n)
            speed = along / mass - rates.y / rates.x
            approach = normal_impulse / mass - speed
            leave = state.colliders.rebound[row]
            if leave == 0.0:
                # The centre of a rotating body can move away from a collider without an earlier approach.
                leave = ti.max(MIN_REBOUND, rates.z / rates.x - approach)
            if approach > RESTITUTION_SPEED:
                leave = ti.max(leave, state.colliders.surface[c].y * approach)
            state.colliders.rebound[row] = leave
            excess = ti.min(mass * (speed - leave), normal_impulse)
            if excess > 0.0:
                moment = ti.Vector.zero(ti.f32, 3)
                for p in range(particles[0], particles[1]):
                    if state.particle_inv_mass[p] > 0.0:
                        moment += state.particle_mass[p] * state.particle_position[p]
                        state.particle_velocity[p] = state.particle_velocity[p] - excess / mass * n
                arm = moment / mass - start_of(state, body, c)
                arm -= state.colliders.velocity[c] * time
                state.colliders.impulse[row] = state.colliders.impulse[row] + excess * n
                turn = state.colliders.angular_impulse[row] + excess * arm.cross(n)
                state.colliders.angular_impulse[row] = turn
            state.colliders.normal_impulse[row] = ti.Vector.zero(ti.f32, 3)
            state.colliders.normal_impulse_rates[row] = ti.Vector.zero(ti.f32, 3)
