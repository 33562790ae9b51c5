"""Pinned particles, which have an inverse mass of zero and a prescribed velocity.

`particle_aim` encodes the motion of a pinned particle in the next step. For particles attached to a frame,
the target is in the frame's axes.
"""

from taichi_soft.bodies.kernels.origins import enter_local, leave_local, local_position, residue_of
from taichi_soft.bodies.kernels.rods import aim_spins
from taichi_soft.bodies.status import (
    ABSENT,
    ACTIVE,
    ARRIVED,
    ASLEEP,
    FEELS_REACTION,
    FROZEN,
    MOVES_PINS,
    SKIPPING,
    STILL,
    TO_TARGET,
    WITH_FRAME,
)
from taichi_soft.core.math.rows import row_at, row_behind
from taichi_soft.core.runtime import ti

FRAME_WIDTH = 15
"""Number of columns of the poses of frames: rotation matrix by rows, position [m], rounding error of the
position."""


@ti.kernel
def pin_particles(state: ti.template(), particles: ti.types.ndarray(dtype=ti.i32, ndim=1)):
    """Pin particles at their current positions, with zero velocity."""
    ti.loop_config(serialize=True)
    for i in range(particles.shape[0]):
        p = particles[i]
        state.particle_inv_mass[p] = 0.0
        state.particle_velocity[p] = ti.Vector.zero(state.real, 3)
        state.particle_aim[p] = STILL
        if ti.static(state.capacity.implicit):
            state.particle_contact[p] = 0


@ti.kernel
def free_particles(state: ti.template(), particles: ti.types.ndarray(dtype=ti.i32, ndim=1)):
    """Unpin particles, by restoring their inverse mass. The particles keep their velocity."""
    ti.loop_config(serialize=True)
    for i in range(particles.shape[0]):
        p = particles[i]
        state.particle_inv_mass[p] = 1.0 / state.particle_mass[p]
        state.particle_aim[p] = STILL


@ti.kernel
def read_pinned(state: ti.template(), begin: ti.i32, pinned: ti.types.ndarray(dtype=ti.i32, ndim=1)):
    """Write 1 for each pinned vertex of one body and 0 for others, in the caller's order."""
    ti.loop_config(serialize=True)
    for i in range(pinned.shape[0]):
        pinned[i] = int(state.particle_inv_mass[state.particle_of_vertex[begin + i]] == 0.0)


@ti.kernel
def write_targets(
    state: ti.template(),
    particles: ti.types.ndarray(dtype=ti.i32, ndim=1),
    targets: ti.types.ndarray(dtype=ti.f64, ndim=2),
    found: ti.types.ndarray(dtype=ti.i32, ndim=1),
):
    """Write the targets of pinned particles, which are their positions at the end of the next step [m].

    If one of the particles is not pinned, nothing is changed.
    Args:
        found: (1,), receives the index in `particles` of the first particle that is not pinned, or -1.
    """
    loose = -1
    ti.loop_config(serialize=True)
    for _ in range(1):
        for i in range(particles.shape[0]):
            if loose < 0 and state.particle_inv_mass[particles[i]] > 0.0:
                loose = i
        if loose < 0:
            for i in range(particles.shape[0]):
                p = particles[i]
                body = state.particle_body[p]
                origin = ti.cast(state.body_origin[body], ti.f64)
                state.particle_target[p] = ti.cast(row_at(targets, i, 0) - origin, state.real)
                state.particle_aim[p] = TO_TARGET
                state.body_drives[body] = state.body_drives[body] | MOVES_PINS
    found[0] = loose


@ti.kernel
def attach_particles(
    state: ti.template(),
    body: ti.i32,
    frame: ti.i32,
    feels: ti.i32,
    particles: ti.types.ndarray(dtype=ti.i32, ndim=1),
    places: ti.types.ndarray(dtype=ti.f32, ndim=2),
):
    """Attach particles of one body to a frame at `places` in the frame's axes, (k, 3) [m].

    If `feels` is 1, record the load on the body's pins.
    """
    i = 0
    while i < particles.shape[0]:
        p = particles[i]
        state.particle_inv_mass[p] = 0.0
        state.particle_aim[p] = WITH_FRAME + frame
        state.particle_target[p] = ti.Vector([places[i, 0], places[i, 1], places[i, 2]])
        state.particle_reaction[p] = ti.Vector.zero(state.real, 3)
        if ti.static(state.capacity.rods):
            state.rod_reaction[p] = ti.Vector.zero(state.real, 3)
        if ti.static(state.capacity.implicit):
            state.particle_contact[p] = 0
        i = row_behind(i)
    bits = MOVES_PINS | ti.select(feels != 0, FEELS_REACTION, 0)
    state.body_drives[body] = state.body_drives[body] | bits


@ti.kernel
def write_feeling(state: ti.template(), body: ti.i32, feels: ti.i32):
    """Record the load on one body's pins if `feels` is 1. Stop recording if `feels` is 0."""
    bit = ti.select(feels != 0, FEELS_REACTION, 0)
    state.body_drives[body] = (state.body_drives[body] & ~FEELS_REACTION) | bit


@ti.kernel
def read_reaction(
    state: ti.template(),
    begin: ti.i32,
    particles: ti.types.ndarray(dtype=ti.i32, ndim=1),
    origin: ti.types.ndarray(dtype=ti.f32, ndim=1),
    load: ti.types.ndarray(dtype=ti.f64, ndim=1),
):
    """Write the impulse of `particles` on their pins in the last step [N s], and its moment [N m s].

    Args:
        origin: point to which the moment refers, (3,) [m].
        load: (6,), receives the impulse and the moment.
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        center = ti.Vector([origin[0], origin[1], origin[2]])
        impulse, moment = ti.Vector.zero(ti.f64, 3), ti.Vector.zero(ti.f64, 3)
        i = 0
        while i < particles.shape[0]:
            part = ti.cast(state.particle_reaction[particles[i]], ti.f64)
            impulse += part
            moment += ti.cast(state.particle_position[particles[i]] - center, ti.f64).cross(part)
            if ti.static(state.capacity.rods):
                moment += ti.cast(state.rod_reaction[particles[i]], ti.f64)
            i = row_behind(i)
        for k in ti.static(range(3)):
            load[k], load[3 + k] = impulse[k], moment[k]


@ti.kernel
def aim_pinned(
    state: ti.template(), body_count: ti.i32, dt: ti.f32, frames: ti.types.ndarray(dtype=ti.f32, ndim=2)
) -> ti.i32:
    """Set the velocities that move pinned particles to their targets in a step of `dt` [s].

    Args:
        frames: poses of all f frames after the step, then before the step, (2 f, `FRAME_WIDTH`).
    Returns: number of bodies for which this kernel must be called again before the following step.
    """
    waiting = 0
    ti.loop_config(serialize=True)
    for body in range(body_count):
        drives = state.body_drives[body]
        if drives & MOVES_PINS != 0 and state.body_status[body] == FROZEN:
            waiting += 1
        elif drives & MOVES_PINS != 0 and state.body_status[body] <= ABSENT:  # not if it was switched off
            moving = 0
            particles = state.body_particles[body]
            p = particles[0]
            while p < particles[1]:
                if state.particle_inv_mass[p] == 0.0:
                    before = state.particle_velocity[p]
                    moving += _aim(state, body, p, dt, frames)
                    change = state.particle_velocity[p] - before
                    if drives & FEELS_REACTION != 0:
                        state.particle_reaction[p] = -change * state.particle_mass[p]
                p = row_behind(p)
            if ti.static(state.capacity.rods):
                enter_local(state, body, state.body_origin[body])
                aim_spins(state, body, dt, frames)
                leave_local(state, body)
            if moving == 0:
                state.body_drives[body] = drives & ~MOVES_PINS
            waiting += int(moving > 0)
            status = state.body_status[body]
            if moving > 0 and (status == ASLEEP or status == SKIPPING):  # noqa: SIM109 - Taichi has no `in`
                state.body_status[body] = ACTIVE
    return waiting


@ti.func
def _aim(state: ti.template(), body, p, dt, frames: ti.template()):
    """Set the velocity of one pinned particle. Return 1 if the next step needs `aim_pinned`."""
    aim = state.particle_aim[p]
    x, goal = state.particle_position[p], state.particle_target[p]
    if (state.body_origin[body] != 0.0).any():
        x = local_position(state, body, p)
    if aim >= WITH_FRAME:
        goal = from_frame(frames, aim - WITH_FRAME, goal, state.body_origin[body])
    elif aim == TO_TARGET:
        state.particle_aim[p] = ARRIVED
    else:
        goal = x
        state.particle_aim[p] = STILL
    state.particle_velocity[p] = (goal - x) / dt
    return int(aim >= WITH_FRAME or aim == TO_TARGET)


@ti.func
def from_frame(frames: ti.template(), frame, local, origin):
    """Transform a point from a frame's axes to world axes [m], relative to `origin`."""
    place = row_at(frames, frame, 9)
    place = place - origin + residue_of(place, row_at(frames, frame, 12))
    return ti.Vector(
        [
            frames[frame, 3 * i] * local.x
            + frames[frame, 3 * i + 1] * local.y
            + frames[frame, 3 * i + 2] * local.z
            + place[i]
            for i in ti.static(range(3))
        ]
    )
