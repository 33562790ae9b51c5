"""Schedule `per_body`: each body runs all substeps of a step on one thread, bodies side by side.

Nothing waits between substeps and a body stays in one core's cache. The result does not depend on the number
of threads.

Substeps are chosen for small deformation; what is flattened is stiffer. Where a step ends non-finite, or
forces changed a particle's velocity by more than `JOLT` at once, the body is put back and makes the step
again with twice as many substeps, and so on. The last attempt brakes its vibrations sharply: momentum and
spin stay.

A long step is made in several calls, so that Ctrl-C can come between: each body goes on where it stopped.
"""

from taichi_soft.bodies.kernels.motion import (
    gravity_on,
    particle_is_sound,
    remember_particle,
    restore_particle,
)
from taichi_soft.bodies.kernels.plasticity import flow_body
from taichi_soft.bodies.status import ABSENT, ACTIVE, FEELS_REACTION, FROZEN, PUSHED
from taichi_soft.control.kernels.drives import add_reactions, blow_on, push_particles
from taichi_soft.control.kernels.grabs import pull_grabs
from taichi_soft.control.kernels.loads import forget_loads
from taichi_soft.core.constants import LANES, ROW_BITS
from taichi_soft.core.runtime import ti
from taichi_soft.core.types import Integrator
from taichi_soft.elements.kernels.internal_forces import accumulate_forces, clear_forces
from taichi_soft.solver.kernels.implicit_euler import implicit_substep
from taichi_soft.solver.kernels.motion import moved_particle
from taichi_soft.solver.kernels.untangling import untangle_body
from taichi_soft.solver.kernels.vibration import damp_vibration

JOLT = 1.0
"""By how much the forces of one substep may change a particle's velocity, over the speed of sound in its
body. Stable vibrations stay below it, on slivers too: a stable substep is about as long as sound takes to
cross the smallest tetrahedron."""


UNFINISHED = -2
"""Instead of a number of bodies: the call made the substeps that it was given, and the step needs more."""

DONE = -1
"""Instead of the number of an attempt: the step is made."""


@ti.func
def _move_block(state: ti.template(), program: ti.template(), first, count, gravity, h, kick):
    """New positions and velocities of up to `LANES` particles from `first` on; their forces are cleared. What
    lies behind them is computed too, and counts nothing.

    Returns: of each the square of its acceleration.
    """
    positions = ti.Matrix.zero(state.real, LANES, 3)
    velocities = ti.Matrix.zero(state.real, LANES, 3)
    acceleration2 = ti.Vector.zero(state.real, LANES)
    # It reads fields and stores here only: whether field and field overlap, the compiler could not tell.
    for lane in range(LANES):
        p = first + lane
        x, v, a = moved_particle(state, program, p, state.particle_force[p].xyz, gravity, h, kick)
        for i in ti.static(range(3)):
            positions[lane, i] = x[i]
            velocities[lane, i] = v[i]
        acceleration2[lane] = a.dot(a)
    if count >= LANES:
        _put_block(state, first, LANES, positions, velocities)
    else:
        _put_block(state, first, count, positions, velocities)
        for lane in range(LANES):
            acceleration2[lane] = ti.select(lane < count, acceleration2[lane], 0.0)
    return acceleration2


@ti.func
def _put_block(state: ti.template(), first, count, positions: ti.template(), velocities: ti.template()):
    """Field by field: a loop over one field, of a length that is known, becomes a few wide stores."""
    for lane in range(count):
        for i in ti.static(range(3)):
            state.particle_position[first + lane][i] = positions[lane, i]
    for lane in range(count):
        for i in ti.static(range(3)):
            state.particle_velocity[first + lane][i] = velocities[lane, i]
    for lane in range(count):
        state.particle_force[first + lane] = ti.Vector.zero(state.real, 4)


@ti.func
def move_body(state: ti.template(), program: ti.template(), body, h, kick):
    """Move all particles of one body and clear their forces.

    Returns: whether these moved no particle too far at once (1).
    """
    particles, gravity = state.body_particles[body], gravity_on(state, body)
    acceleration2 = ti.Vector.zero(state.real, LANES)
    for block in range((particles[1] - particles[0] + LANES - 1) // LANES):
        first = (particles[0] + block * LANES) & ROW_BITS
        a2 = _move_block(state, program, first, particles[1] - first, gravity, h, kick)
        acceleration2 = ti.max(acceleration2, a2)
    return int(kick * ti.sqrt(acceleration2.max()) <= JOLT * state.body_sound_speed[body])


@ti.func
def advance_body(state: ti.template(), program: ti.template(), body, h, kick, s, substeps):
    """Substep `s` of `substeps` of one body.

    Returns: whether forces moved no particle too far at once (1); by implicit Euler always.
    """
    is_gentle, is_first = 1, int(s == 0)
    blow_on(state, body, h)
    push_particles(state, body, before_kick(program, h, is_first))
    if ti.static(program.integrator == Integrator.IMPLICIT_EULER):
        damp_vibration(state, program, body, 0.0, h, s, substeps)
        implicit_substep(state, program, body, h, is_first)
    else:
        lasting = kick if ti.static(program.integrator == Integrator.LEAPFROG) else h
        accumulate_forces(state, program, body)
        add_reactions(state, body, lasting)
        pull_grabs(state, body, h, lasting)
        damp_vibration(state, program, body, lasting, h, s, substeps)
        is_gentle = move_body(state, program, body, h, kick)
    return is_gentle


@ti.func
def before_kick(program: ti.template(), h, is_first):
    """For how long drives act before a substep [s]."""
    return 0.5 * h if ti.static(program.integrator == Integrator.LEAPFROG) and is_first == 1 else h


@ti.func
def body_is_sound(state: ti.template(), body):
    """Whether all of a body can still be computed with (1)."""
    particles = state.body_particles[body]
    sound = 1
    for p in range(particles[0], particles[1]):
        sound = sound & particle_is_sound(state, p)
    return sound


@ti.func
def _settle_body(state: ti.template(), body):
    """Freeze a body that went non-finite in its last sound state. Returns 1 where that happened."""
    sound = body_is_sound(state, body)
    if sound == 0:
        particles = state.body_particles[body]
        for p in range(particles[0], particles[1]):
            restore_particle(state, p)
        clear_forces(state, body)
        forget_loads(state, body)
        state.body_status[body] = FROZEN
    return 1 - sound


@ti.func
def end_body(state: ti.template(), program: ti.template(), body, substeps, h):
    """What comes after the last substep of an active body. Returns 1 where it failed."""
    if ti.static(program.integrator == Integrator.LEAPFROG):
        push_particles(state, body, 0.5 * h)
    failed = _settle_body(state, body)
    if failed == 0:
        state.body_velocity_lag[body] = h
        state.body_drives[body] = state.body_drives[body] & ~PUSHED
        if ti.static(program.has_plasticity):
            flow_body(state, body, substeps * h)
        untangle_body(state, program, body, substeps * h)
    return failed


@ti.func
def remember_body(state: ti.template(), body):
    """Keep how a body is before the step: to interpolate from, and to fall back to."""
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        remember_particle(state, p)
    if state.body_drives[body] & FEELS_REACTION != 0:
        for p in range(particles[0], particles[1]):
            if state.body_status[body] == FROZEN:  # nobody aims at where its pins go, and begins anew
                state.particle_reaction[p] = ti.Vector.zero(state.real, 3)
            state.prev_reaction[p] = state.particle_reaction[p]


@ti.func
def put_back_body(state: ti.template(), body):
    """Put a body back to where it was before the step."""
    state.body_jolted[body] = 1
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        restore_particle(state, p)
        if state.body_drives[body] & FEELS_REACTION != 0:
            state.particle_reaction[p] = state.prev_reaction[p]
    clear_forces(state, body)


@ti.func
def fineness(retries, attempt):
    """Into how many pieces a substep is cut in an attempt; the last is no finer than the one before."""
    return 1 << ti.min(attempt, retries)


@ti.func
def last_attempt(retries):
    """Number of the last attempt at a step that fails, from 0."""
    return ti.select(retries > 0, retries + 1, 0)


@ti.func
def _attempt_body(state: ti.template(), program: ti.template(), body, substeps, h, first, last):
    """Substeps from `first` to before `last`, of so many in an attempt of one body.

    Returns: whether forces moved no particle too far at once (1).
    """
    is_gentle, kick = 1, ti.cast(h, ti.f32)
    if first == 0:
        kick = 0.5 * (state.body_velocity_lag[body] + h)
    for s in range(first, last):
        is_gentle = is_gentle & advance_body(state, program, body, h, kick, s, substeps)
        kick = h
    return is_gentle


@ti.real_func
def _step_body(
    state: ti.template(),
    program: ti.template(),
    body: ti.i32,
    substeps: ti.i32,
    h: ti.f32,
    most: ti.i32,
    goes_on: ti.i32,
) -> ti.i32:
    """One fixed step of one body, as fine as it needs, or the next `most` substeps of it.

    By itself, so that sums are rounded alike in the kernels for one thread and for several; and there is no
    other such function in them, because Taichi's cache would not find them again otherwise.

    Returns: 1 where it failed, or was not solved as exactly as asked; or UNFINISHED.
    """
    if goes_on == 0:
        state.body_pause[body] = ti.Vector([0, 0, 1])
        if state.body_status[body] != ABSENT:
            remember_body(state, body)
    attempt, s, is_gentle = state.body_pause[body]
    found = 0
    if attempt == DONE:
        found = s
    elif state.body_status[body] == ACTIVE:
        retries = state.retries[None]
        if ti.static(program.integrator == Integrator.IMPLICIT_EULER):
            retries = 0  # it cuts its substeps by itself
        finer, is_open, left = 1, 1, most
        while is_open == 1 and left > 0:
            finer = fineness(retries, attempt)
            state.body_is_braked[body] = int(attempt > retries)
            last = ti.min(s + left, finer * substeps)
            gently = _attempt_body(state, program, body, finer * substeps, h / finer, s, last)
            is_gentle, left, s = is_gentle & gently, left - (last - s), last
            if s == finer * substeps:
                if attempt == last_attempt(retries) or is_gentle & body_is_sound(state, body) == 1:
                    is_open = 0
                else:
                    put_back_body(state, body)
                    attempt, s, is_gentle = attempt + 1, 0, 1
        if is_open == 1:
            found = UNFINISHED
        else:
            found = end_body(state, program, body, finer * substeps, h / finer)
            state.body_is_braked[body] = 0
            if found == 0:
                if ti.static(program.integrator == Integrator.IMPLICIT_EULER):
                    found = int(state.body_residual[body] > state.solver[None][0])
            attempt, s = DONE, found
        state.body_pause[body] = ti.Vector([attempt, s, is_gentle])
    return found


@ti.kernel
def step_per_body(
    state: ti.template(),
    program: ti.template(),
    body_count: ti.i32,
    substeps: ti.i32,
    h: ti.f32,
    most: ti.i32,
    goes_on: ti.i32,
) -> ti.i32:
    """One fixed step of every active body, side by side, or the next `most` substeps of it.

    Returns: how many had trouble in it, or UNFINISHED: then it is to be called again, with `goes_on` 1.
    """
    failed, unfinished = 0, 0
    ti.loop_config(block_dim=1)
    for body in range(body_count):
        found = _step_body(state, program, body, substeps, h, most, goes_on)
        failed += ti.max(found, 0)
        unfinished += int(found == UNFINISHED)
    return ti.select(unfinished > 0, UNFINISHED, failed)


@ti.kernel
def step_in_turn(
    state: ti.template(),
    program: ti.template(),
    body_count: ti.i32,
    substeps: ti.i32,
    h: ti.f32,
    most: ti.i32,
    goes_on: ti.i32,
) -> ti.i32:
    """As `step_per_body` in the calling thread: a single body need not wait for another thread to wake up."""
    failed, unfinished = 0, 0
    ti.loop_config(serialize=True)
    for body in range(body_count):
        found = _step_body(state, program, body, substeps, h, most, goes_on)
        failed += ti.max(found, 0)
        unfinished += int(found == UNFINISHED)
    return ti.select(unfinished > 0, UNFINISHED, failed)
