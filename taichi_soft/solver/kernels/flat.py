"""Schedule `flat`: in each substep, process all tetrahedra of all bodies in parallel, then all particles.

This schedule is for bodies too large for one thread. Forces are stored per corner and per edge. The forces on
each particle are added in a fixed order, so the result does not depend on the number of threads.

On a CPU, all substeps run inside one kernel call: one task per thread, synchronised by a spinning barrier.
Starting a parallel loop costs 5 to 90 us, a barrier less than 1 us. All tasks of a loop run at the same time,
because Taichi's pool has exactly as many threads as there are tasks. But if another program occupies a core,
every barrier can wait for the operating system, so only very large bodies use this schedule by default. A GPU
has no such barrier, so on a GPU each substep is a separate launch.
"""

from taichi_soft.bodies.kernels.origins import local_floor
from taichi_soft.bodies.kernels.particles import (
    gravity_on,
    particle_is_valid,
    restore_particle,
    save_particle,
)
from taichi_soft.bodies.kernels.plasticity import flow_block
from taichi_soft.bodies.status import ABSENT, ACTIVE, FROZEN, FROZEN_DISABLED
from taichi_soft.contact.distances.floor import resolve_floor
from taichi_soft.core.constants import LANES
from taichi_soft.core.math.tensors import widened
from taichi_soft.core.runtime import ti
from taichi_soft.elements.kernels.bonds import lane_pressure, store_block_pressures
from taichi_soft.elements.kernels.edges import edge_force_of
from taichi_soft.elements.kernels.elastic import store_block_forces, store_lane_forces
from taichi_soft.elements.kernels.internal_forces import accumulate_forces, clear_forces
from taichi_soft.solver.kernels.kick import MAX_VELOCITY_CHANGE
from taichi_soft.solver.kernels.vibration import damp_vibration, kept_vibration

# Additional body statuses, larger than all others. A _FAILING body must retry the step. A _DONE body has
# completed the step.
_FAILING, _DONE = FROZEN_DISABLED + 1, FROZEN_DISABLED + 2


@ti.func
def _status_of(state: ti.template(), p):
    return state.body_status[state.particle_body[p]]


@ti.func
def _block_is_active(state: ti.template(), block):
    return _status_of(state, state.tet_vertices[block * 4 * LANES]) == ACTIVE


@ti.func
def _save_phase(state: ti.template(), p):
    if _status_of(state, p) != ABSENT:
        save_particle(state, p)


@ti.func
def _block_phase(state: ti.template(), program: ti.template(), block):
    is_active = _block_is_active(state, block)
    for m, model in ti.static(enumerate(program.models)):
        if is_active and state.block_model[block] == m:
            if ti.static(model.has_tets):
                store_block_forces(state, model, block)
            elif ti.static(model.reads_expansion):
                store_block_pressures(state, block)


@ti.func
def _edge_phase(state: ti.template(), program: ti.template(), e):
    body = state.particle_body[state.edge_vertices[e][0]]
    is_active = state.body_status[body] == ACTIVE
    for m, model in ti.static(enumerate(program.models)):
        if is_active and state.body_model[body] == m:
            state.edge_force[e] = edge_force_of(state, model, e)


@ti.func
def gathered_force(state: ti.template(), p):
    """Return the internal force on one particle [N]: the sum of its corner forces and its edge forces."""
    total = ti.Vector.zero(state.real, 4)
    corners = state.particle_corners[p]  # empty if the body's law acts on edges
    for k in range(corners[0], corners[1]):
        total += state.corner_force[state.corner_slot[k]]
    force = total.xyz
    edges = state.particle_edges[p]
    for k in range(edges[0], edges[1]):
        e = state.incident_edge[k]
        if e >= 0:
            force += state.edge_force[e]
        else:
            force -= state.edge_force[-1 - e]
    return force


@ti.func
def _felt_time(state: ti.template(), program: ti.template(), body, h, s):
    return program.integrator.felt_time(state.body_velocity_lag[body], h, s)


@ti.func
def _moved_particle(state: ti.template(), program: ti.template(), p, force, gravity, h, kick):
    """Compute the motion of one particle in a substep, from gravity and its internal `force` [N].

    A pinned particle keeps its velocity.

    Returns: new position [m] and velocity [m/s], and acceleration [m/s^2].
    """
    inv_mass = state.particle_inv_mass[p]
    is_free = inv_mass > 0.0
    acceleration = (force * inv_mass + gravity) * ti.select(is_free, 1.0, 0.0)
    x, v = program.integrator.advance(
        state.particle_position[p], state.particle_velocity[p], acceleration, h, kick
    )
    if ti.static(program.has_floor):
        if is_free:
            x, v = resolve_floor(x, v, h, local_floor(state, state.particle_body[p]))
    return x, v, acceleration


@ti.func
def _move_phase(state: ti.template(), program: ti.template(), p, h, s):
    body = state.particle_body[p]
    if state.body_status[body] == ACTIVE:
        kick = _felt_time(state, program, body, h, s)
        force, gravity = gathered_force(state, p), gravity_on(state, body)
        x, v, a = _moved_particle(state, program, p, force, gravity, h, kick)
        state.particle_position[p] = x
        state.particle_velocity[p] = v
        if not (kick * a.norm() <= MAX_VELOCITY_CHANGE * state.body_sound_speed[body]):
            state.body_jolted[body] = 1


@ti.func
def _is_damped_now(state: ti.template(), body, h, s, substeps):
    return state.body_status[body] == ACTIVE and kept_vibration(state, body, h, s, substeps) < 1.0


@ti.func
def _gather_phase(state: ti.template(), p, h, s, substeps):
    """Write the force on a particle to the field that damping reads, if its body is damped now."""
    if _is_damped_now(state, state.particle_body[p], h, s, substeps):
        state.particle_force[p] = widened(gathered_force(state, p))


@ti.func
def _damp_phase(state: ti.template(), program: ti.template(), body, h, s, substeps):
    if _is_damped_now(state, body, h, s, substeps):
        damp_vibration(
            state,
            program,
            body,
            _felt_time(state, program, body, h, s),
            h,
            s,
            substeps,
        )
        clear_forces(state, body)


@ti.func
def substep_alone(state: ti.template(), program: ti.template(), body, h, s, substeps):
    """Run one substep of one body in one thread, to find the cause of its failure."""
    accumulate_forces(state, program, body)
    kick = _felt_time(state, program, body, h, s)
    damp_vibration(state, program, body, kick, h, s, substeps)
    for p in range(state.body_particles[body][0], state.body_particles[body][1]):
        force, gravity = state.particle_force[p].xyz, gravity_on(state, body)
        x, v, _ = _moved_particle(state, program, p, force, gravity, h, kick)
        state.particle_position[p] = x
        state.particle_velocity[p] = v
    clear_forces(state, body)


@ti.func
def _begin_phase(state: ti.template(), p, is_again):
    """Save the state of a particle, in the first attempt only."""
    if is_again == 0:
        _save_phase(state, p)


@ti.func
def _check_phase(state: ti.template(), p, is_last):
    body = state.particle_body[p]
    if state.body_status[body] == ACTIVE:
        is_jolted = is_last == 0 and state.body_jolted[body] == 1
        if is_jolted or particle_is_valid(state, p, state.body_origin[body]) == 0:
            ti.atomic_max(state.body_status[body], _FAILING)


@ti.func
def _restore_phase(state: ti.template(), p):
    if _status_of(state, p) == _FAILING:
        restore_particle(state, p)


@ti.func
def _flow_phase(state: ti.template(), block, dt):
    body = state.particle_body[state.tet_vertices[block * 4 * LANES]]
    if state.body_status[body] == ACTIVE:
        flow_block(state, body, block, dt)


@ti.func
def _end_attempt(state: ti.template(), body, h, is_braked, is_last):
    """End an attempt of a body. A failed body retries the step, or is frozen after the last attempt.

    Returns: 1 if the body failed.
    """
    failed = 0
    state.body_jolted[body] = 0
    if state.body_status[body] == _FAILING:
        state.body_status[body] = ti.select(is_last == 1, FROZEN, ACTIVE)
        state.body_is_braked[body] = is_braked
        failed = 1
    elif state.body_status[body] == ACTIVE:
        state.body_velocity_lag[body] = h
        state.body_status[body] = _DONE
    return failed


@ti.func
def _end_step(state: ti.template(), body_count):
    """After the last attempt, prepare the completed bodies for the next step."""
    for body in range(body_count):
        state.body_is_braked[body] = 0
        if state.body_status[body] == _DONE:
            state.body_status[body] = ACTIVE


@ti.func
def _wait_for_workers(state: ti.template(), worker_count: ti.template()):
    """Wait until all workers have called this function as often as this worker."""
    arrived = ti.atomic_add(state.barrier[0], 1) + 1
    target = (arrived + worker_count - 1) // worker_count * worker_count
    # An atomic maximum with -1 changes nothing, but the compiler cannot turn it into a plain load.
    while ti.atomic_max(state.barrier[0], -1) < target:
        pass


@ti.kernel
def step_flat_cpu(
    state: ti.template(),
    program: ti.template(),
    body_count: ti.i32,
    block_count: ti.i32,
    edge_count: ti.i32,
    particle_count: ti.i32,
    substeps: ti.i32,
    h: ti.f32,
    first: ti.i32,
    last: ti.i32,
    attempt: ti.i32,
    attempts: ti.i32,
) -> ti.i32:
    """Run substeps `first` to `last` - 1 of `substeps` in one attempt at a fixed step.

    The kernel acts on all bodies that have not completed the step, with `program.worker_count` threads.
    Returns: the number of failed bodies.
    """
    failed = 0
    state.barrier[0] = 0
    ti.loop_config(block_dim=1)
    for worker in range(program.worker_count):
        workers = program.worker_count
        p0, p1 = particle_count * worker // workers, particle_count * (worker + 1) // workers
        b0, b1 = block_count * worker // workers, block_count * (worker + 1) // workers
        e0, e1 = edge_count * worker // workers, edge_count * (worker + 1) // workers
        if first == 0:
            for p in range(p0, p1):
                _begin_phase(state, p, attempt)
        for s in range(first, last):
            for block in range(b0, b1):
                _block_phase(state, program, block)
            if ti.static(program.reads_expansion):
                _wait_for_workers(state, workers)
            for e in range(e0, e1):
                _edge_phase(state, program, e)
            _wait_for_workers(state, workers)
            is_damped = 0
            for body in range(body_count):
                is_damped = is_damped | int(_is_damped_now(state, body, h, s, substeps))
            if is_damped == 1:
                for p in range(p0, p1):
                    _gather_phase(state, p, h, s, substeps)
                _wait_for_workers(state, workers)
                for i in range((body_count - worker + workers - 1) // workers):
                    _damp_phase(state, program, worker + i * workers, h, s, substeps)
                _wait_for_workers(state, workers)
            for p in range(p0, p1):
                _move_phase(state, program, p, h, s)
            _wait_for_workers(state, workers)
        if last == substeps:
            for p in range(p0, p1):
                _check_phase(state, p, int(attempt == attempts - 1))
            _wait_for_workers(state, workers)
            for p in range(p0, p1):
                _restore_phase(state, p)
            if ti.static(program.has_plasticity):
                for block in range(b0, b1):
                    _flow_phase(state, block, substeps * h)
    ti.loop_config(serialize=True)
    for _ in range(1):
        if last == substeps:
            for body in range(body_count):
                is_last = int(attempt == attempts - 1)
                failed += _end_attempt(state, body, h, int(attempt == attempts - 2), is_last)
            if failed == 0 or attempt == attempts - 1:
                _end_step(state, body_count)
    return failed


@ti.kernel
def begin_flat(state: ti.template(), particle_count: ti.i32):
    """Save the state of every particle."""
    for p in range(particle_count):
        _save_phase(state, p)


@ti.kernel
def substep_flat(
    state: ti.template(),
    program: ti.template(),
    body_count: ti.i32,
    block_count: ti.i32,
    edge_count: ti.i32,
    particle_count: ti.i32,
    substeps: ti.i32,
    h: ti.f32,
    s: ti.i32,
):
    """Run one substep with one tetrahedron, edge or particle per thread."""
    for t in range(block_count * LANES):
        block, lane = t // LANES, t % LANES
        is_active = _block_is_active(state, block)
        for m, model in ti.static(enumerate(program.models)):
            if is_active and state.block_model[block] == m:
                if ti.static(model.has_tets):
                    store_lane_forces(state, model, block, lane)
                elif ti.static(model.reads_expansion):
                    state.tet_pressure[t] = lane_pressure(state, block, lane)
    for e in range(edge_count):
        _edge_phase(state, program, e)
    for p in range(particle_count):
        _gather_phase(state, p, h, s, substeps)
    for body in range(body_count):
        _damp_phase(state, program, body, h, s, substeps)
    for p in range(particle_count):
        _move_phase(state, program, p, h, s)


@ti.kernel
def end_flat(
    state: ti.template(),
    program: ti.template(),
    body_count: ti.i32,
    block_count: ti.i32,
    particle_count: ti.i32,
    substeps: ti.i32,
    h: ti.f32,
    attempt: ti.i32,
    attempts: ti.i32,
) -> ti.i32:
    """End an attempt at a step, and restore failed bodies. Returns: the number of failed bodies."""
    failed = 0
    for p in range(particle_count):
        _check_phase(state, p, int(attempt == attempts - 1))
    for p in range(particle_count):
        _restore_phase(state, p)
    if ti.static(program.has_plasticity):
        for block in range(block_count):
            _flow_phase(state, block, substeps * h)
    for body in range(body_count):
        is_last = int(attempt == attempts - 1)
        failed += _end_attempt(state, body, h, int(attempt == attempts - 2), is_last)
    return failed


@ti.kernel
def finish_flat(state: ti.template(), body_count: ti.i32):
    """End the step of all bodies after the last attempt."""
    ti.loop_config(serialize=True)
    for _ in range(1):
        _end_step(state, body_count)
