"""Bring slow bodies to rest that lie on something fixed.

A pile sways, rocks and rolls on itself for many seconds: its bodies hardly deform in this motion, and
material damping acts on deformation only. Real bodies lose this motion by hysteresis where they touch.

Bodies in the air, islands that touch nothing fixed, and islands with a driven body are not slowed down. The
effect is proportional to friction, so that a body without friction keeps sliding.

Groups of fields: reads colliders, islands, motors.
"""

from taichi_soft.bodies.status import ACTIVE, GRABBED, MOVES_PINS
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti

PILE_LIMIT, PILE_RATE = 3.0, 20.0
"""Limit for the mean speed of an island of several bodies, as a multiple of `sleep_speed`, and decay rate of
velocities in a slower island, relative to friction [1/s].

A body faster than `sleep_speed` loses only as much speed in a second as a body at `sleep_speed`. With the
defaults this is 0.2 m/s, as by rolling friction with a coefficient of 0.02."""

BODY_LIMIT, BODY_RATE = 1.0, 4.0
"""The same for a body alone in its island. Faster bodies vibrate as their material says, and a ball starts to
roll down a slope of half a degree."""


@ti.func
def _is_slow(state: ti.template(), island, limit):
    """Return 1 if the root mean square speed of an island's bodies is below `limit` [m/s]."""
    motion, count = ti.cast(0.0, ti.f32), 0
    for i in range(state.islands.first[island], state.islands.first[island + 1]):
        body = state.islands.body[i]
        if state.body_status[body] == ACTIVE:
            motion += state.islands.mean_speed[body] * state.islands.mean_speed[body]
            count += 1
    return int(motion <= limit * limit * count)


@ti.func
def _is_driven(state: ti.template(), body):
    """Return 1 if a motor, a grab or moving pins act on a body."""
    return int(state.body_drives[body] & (MOVES_PINS | GRABBED) != 0) | state.motors.is_driven[body]


@ti.func
def _is_pinned(state: ti.template(), body):
    """Return 1 if a particle of a body is pinned."""
    is_pinned, p = 0, state.body_particles[body][0]
    while p < state.body_particles[body][1]:
        is_pinned |= int(state.particle_inv_mass[p] == 0.0)
        p = row_behind(p)
    return is_pinned


@ti.func
def _is_touched(state: ti.template(), body):
    """Return 1 if a body touched something in the last substep."""
    touches, p = 0, state.body_particles[body][0]
    while p < state.body_particles[body][1]:
        touches |= state.particle_touches[p]
        p = row_behind(p)
    return touches


@ti.func
def _friction_with_colliders(state: ti.template(), body):
    """Return the largest friction of the colliders that a body touched in this step, or -1 without contact;
    and 1 if one of them moves.
    """
    friction, is_moving, row = ti.cast(-1.0, ti.f32), 0, body * state.colliders.capacity.colliders
    for k in range(state.colliders.near_count[body]):
        c = state.colliders.near[row + k]
        if ti.abs(state.colliders.impulse[row + c]).max() > 0.0:
            friction = ti.max(friction, state.colliders.surface[c].x)
            along = state.colliders.surface_velocity[c]
            is_moving |= int(state.colliders.speed[c] + ti.abs(along).max() > 0.0)
    return friction, is_moving


@ti.func
def _rests(state: ti.template(), island):
    """Return 1 if a body of an island touches a collider or is pinned, and nothing drives the island."""
    is_held, is_driven = 0, 0
    for i in range(state.islands.first[island], state.islands.first[island + 1]):
        body = state.islands.body[i]
        friction, is_moving = _friction_with_colliders(state, body)
        is_driven |= is_moving | _is_driven(state, body)
        is_held |= int(friction >= 0.0)
        if is_held == 0:
            is_held = _is_pinned(state, body)
    return is_held & (1 - is_driven)


@ti.func
def _settle_body(state: ti.template(), body, decay):
    """Reduce the velocities of a body. `decay` is the decay in this step with a friction of 1."""
    friction, _ = _friction_with_colliders(state, body)
    if friction < 0.0:
        friction = state.body_surface[body].x
    speed = ti.max(state.islands.mean_speed[body], state.sleep_speed[None])
    keep = ti.max(0.0, 1.0 - friction * decay * state.sleep_speed[None] / speed)
    p = state.body_particles[body][0]
    while p < state.body_particles[body][1]:
        if state.particle_inv_mass[p] > 0.0:
            state.particle_velocity[p] = keep * state.particle_velocity[p]
        p = row_behind(p)


@ti.real_func
def settle_island(state: ti.template(), island: ti.i32, dt: ti.f32):
    """Slow down the bodies of a slow island that rests on something, for a step of `dt` [s]."""
    first, end = state.islands.first[island], state.islands.first[island + 1]
    limit, rate = BODY_LIMIT, BODY_RATE
    if end - first > 1:
        limit, rate = PILE_LIMIT, PILE_RATE
    limit *= state.sleep_speed[None]
    if limit > 0.0 and _is_slow(state, island, limit) == 1 and _rests(state, island) == 1:
        for i in range(first, end):
            body = state.islands.body[i]
            if state.body_status[body] == ACTIVE and _is_touched(state, body) == 1:
                _settle_body(state, body, rate * dt)
