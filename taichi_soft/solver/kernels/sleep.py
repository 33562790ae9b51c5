"""Sleep: islands at rest are skipped until something approaches or acts on them.

Groups of fields: reads colliders, hull, islands.
"""

from taichi_soft.bodies.kernels.particles import largest_displacement
from taichi_soft.bodies.kernels.rods import stop_spins
from taichi_soft.bodies.status import ACTIVE, ASLEEP, SKIPPING
from taichi_soft.contact.fields import NO_COLLIDER
from taichi_soft.contact.kernels.collider_frames import radius_of
from taichi_soft.contact.kernels.hull_points import place_points
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti

CALM_TIME = 0.5
"""Time for which all bodies of an island must stay slow before the island falls asleep [s]. It is long enough
that a thrown body does not fall asleep at its highest point."""

WAKE_MARGIN = 0.01
"""Margin around the box of a sleeping or skipping body [m]. A moving collider within this margin, or a
change of the world there, wakes the body."""


@ti.func
def _wake_in_box(state: ti.template(), body_count, lower, upper):
    """Wake the bodies that sleep or skip the step near the box from `lower` to `upper`.

    Returns: the number of woken bodies.
    """
    woken = 0
    for body in range(body_count):
        if state.body_status[body] == ASLEEP or state.body_status[body] == SKIPPING:
            above = (lower - state.body_bounds_upper[body]).max()
            if ti.max(above, (state.body_bounds_lower[body] - upper).max()) <= WAKE_MARGIN:
                state.body_status[body] = ACTIVE
                woken += 1
    return woken


@ti.func
def wake_by_colliders(state: ti.template(), body_count):
    """Wake sleeping and skipping bodies that a moving collider approaches in this step."""
    for c in range(state.colliders.count[None]):
        if state.colliders.kind[c] != NO_COLLIDER and state.colliders.speed[c] > 0.0:
            _wake_in_box(state, body_count, state.colliders.lower[c], state.colliders.upper[c])


@ti.real_func
def wake_island(state: ti.template(), island: ti.i32) -> ti.i32:
    """Wake all bodies of an island if a body of the island is awake. Returns: 1 if the island is awake."""
    first, last = state.islands.first[island], state.islands.first[island + 1]
    is_awake = 0
    i = first
    while i < last:
        is_awake = is_awake | int(state.body_status[state.islands.body[i]] == ACTIVE)
        i = row_behind(i)
    i = ti.select(is_awake == 1, first, last)
    while i < last:
        body = state.islands.body[i]
        if state.body_status[body] == ASLEEP or state.body_status[body] == SKIPPING:
            state.body_status[body] = ACTIVE
        i = row_behind(i)
    return is_awake


@ti.func
def update_rest_timer(state: ti.template(), body, dt):
    """Restart the rest timer of a body if it was too fast for sleep in a step of `dt` [s].

    The displacements of particles count, not their velocities. Contact can make a particle of a resting body
    oscillate from substep to substep. The mean speed of the body detects vibrations with the period of the
    step.
    """
    if state.sleep_speed[None] > 0.0:
        speed = ti.max(largest_displacement(state, body) / dt, state.islands.mean_speed[body])
        if not (speed <= state.sleep_speed[None]) and state.body_calm_time[body] != 0.0:
            state.body_calm_time[body] = 0.0


@ti.func
def store_box(state: ti.template(), body):
    """Store the box around a body and its hull, for a body that does not move."""
    particles = state.body_particles[body]
    lower = state.particle_position[particles[0]]
    upper = lower
    p = particles[0]
    while p < particles[1]:
        x = state.particle_position[p]
        lower, upper = ti.min(lower, x), ti.max(upper, x)
        p = row_behind(p)
    if ti.static(state.capacity.contact.hull):
        place_points(state, body)
        for point in range(state.hull.body_points[body][0], state.hull.body_points[body][1]):
            x = state.particle_position[point]
            lower, upper = ti.min(lower, x), ti.max(upper, x)
    radius = radius_of(state, body)
    state.body_bounds_lower[body], state.body_bounds_upper[body] = lower - radius, upper + radius


@ti.real_func
def store_boxes_of_skipping(state: ti.template(), body_count: ti.i32):
    """Store the boxes around bodies that skip the next step.

    Call this directly before the step, because a body can still be moved after `skip_bodies`.
    """
    for body in range(body_count):
        if state.body_status[body] == SKIPPING:
            store_box(state, body)


@ti.func
def _put_to_sleep(state: ti.template(), body):
    """Stop a body and reset its rest timer."""
    particles = state.body_particles[body]
    p = particles[0]
    while p < particles[1]:
        state.prev_position[p] = state.particle_position[p]
        state.particle_velocity[p] = ti.Vector.zero(state.real, 3)
        state.prev_velocity[p] = ti.Vector.zero(state.real, 3)
        p = row_behind(p)
    if ti.static(state.capacity.rods):
        stop_spins(state, body)
    store_box(state, body)
    state.body_velocity_lag[body] = 0.0
    state.body_calm_time[body] = 0.0
    state.body_status[body] = ASLEEP


@ti.real_func
def update_sleep(state: ti.template(), island: ti.i32, dt: ti.f32) -> ti.i32:
    """Add a step of `dt` [s] to the rest timers of an island.

    If all timers exceed `CALM_TIME`, put the island to sleep.

    Returns: 1 if the island is still awake.
    """
    first, last = state.islands.first[island], state.islands.first[island + 1]
    calm = ti.cast(1e30, ti.f32)
    row = first
    while row < last:
        body = state.islands.body[row]
        if state.body_status[body] == ACTIVE:
            state.body_calm_time[body] = state.body_calm_time[body] + dt
            calm = ti.min(calm, state.body_calm_time[body])
        row = row_behind(row)
    is_awake = int(not (calm > CALM_TIME and state.sleep_speed[None] > 0.0))
    if is_awake == 0:
        for i in range(first, last):
            body = state.islands.body[i]
            if state.body_status[body] == ACTIVE:
                _put_to_sleep(state, body)
    return is_awake


@ti.kernel
def wake_body(state: ti.template(), body: ti.i32):
    """Wake one body, or all bodies if `body` is -1, and restart the rest timers."""
    ti.loop_config(serialize=True)
    for b in range(state.capacity.bodies):
        if body == b or body == -1:
            state.body_calm_time[b] = 0.0
            if state.body_status[b] == ASLEEP:
                state.body_status[b] = ACTIVE


@ti.kernel
def wake_near(
    state: ti.template(), body_count: ti.i32, box: ti.types.ndarray(dtype=ti.f32, ndim=1)
) -> ti.i32:
    """Wake the bodies that sleep or skip the step near a box.

    Args:
        box: lower and upper corner of the box [m], (6,).
    Returns: the number of woken bodies.
    """
    woken = 0
    ti.loop_config(serialize=True)
    for _ in range(1):
        store_boxes_of_skipping(state, body_count)
        lower, upper = ti.Vector([box[0], box[1], box[2]]), ti.Vector([box[3], box[4], box[5]])
        woken = _wake_in_box(state, body_count, lower, upper)
    return woken
