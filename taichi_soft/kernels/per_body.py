"""Schedule `per_body`: each body runs all substeps of a step on one thread, bodies side by side.

Nothing waits between substeps and a body stays in one core's cache. The result does not depend on the number
of threads.
"""

from taichi_soft.kernels.drives import add_reactions, blow_on, push_particles
from taichi_soft.kernels.grabs import pull_grabs
from taichi_soft.kernels.implicit_euler import implicit_substep
from taichi_soft.kernels.internal_forces import accumulate_forces, clear_forces
from taichi_soft.kernels.loads import forget_loads
from taichi_soft.kernels.motion import (
    gravity_on,
    move_particle,
    particle_is_sound,
    remember_particle,
    restore_particle,
)
from taichi_soft.kernels.plasticity import flow_body
from taichi_soft.runtime import ti
from taichi_soft.state import ABSENT, ACTIVE, FROZEN, PUSHED
from taichi_soft.types import Integrator


@ti.func
def move_body(state: ti.template(), program: ti.template(), body, h, kick):
    """Move all particles of one body and clear their forces."""
    particles = state.body_particles[body]
    gravity = gravity_on(state, body)
    for p in range(particles[0], particles[1]):
        move_particle(state, program, p, state.particle_force[p].xyz, gravity, h, kick)
        state.particle_force[p] = ti.Vector.zero(state.real, 4)


@ti.func
def advance_body(state: ti.template(), program: ti.template(), body, h, kick, is_first):
    """One substep of one body."""
    blow_on(state, body, h)
    push_particles(state, body, before_kick(program, h, is_first))
    if ti.static(program.integrator == Integrator.IMPLICIT_EULER):
        implicit_substep(state, program, body, h, is_first)
    else:
        lasting = kick if ti.static(program.integrator == Integrator.LEAPFROG) else h
        accumulate_forces(state, program, body)
        add_reactions(state, body, lasting)
        pull_grabs(state, body, h, lasting)
        move_body(state, program, body, h, kick)


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
    return failed


@ti.func
def _step_body(state: ti.template(), program: ti.template(), body, substeps, h):
    """One fixed step of one body. Returns 1 where it failed, or was not solved as exactly as asked."""
    if state.body_status[body] != ABSENT:
        particles = state.body_particles[body]
        for p in range(particles[0], particles[1]):
            remember_particle(state, p)
    failed = 0
    if state.body_status[body] == ACTIVE:
        kick = 0.5 * (state.body_velocity_lag[body] + h)
        for s in range(substeps):
            advance_body(state, program, body, h, kick, int(s == 0))
            kick = h
        failed = end_body(state, program, body, substeps, h)
        if failed == 0:
            if ti.static(program.integrator == Integrator.IMPLICIT_EULER):
                failed = int(state.body_residual[body] > state.solver[None][0])
    return failed


@ti.kernel
def step_per_body(
    state: ti.template(), program: ti.template(), body_count: ti.i32, substeps: ti.i32, h: ti.f32
) -> ti.i32:
    """One fixed step of every active body, side by side. Returns how many had trouble in it."""
    failed = 0
    ti.loop_config(block_dim=1)
    for body in range(body_count):
        failed += _step_body(state, program, body, substeps, h)
    return failed


@ti.kernel
def step_in_turn(
    state: ti.template(), program: ti.template(), body_count: ti.i32, substeps: ti.i32, h: ti.f32
) -> ti.i32:
    """As `step_per_body` in the calling thread: a single body need not wait for another thread to wake up."""
    failed = 0
    ti.loop_config(serialize=True)
    for body in range(body_count):
        failed += _step_body(state, program, body, substeps, h)
    return failed
