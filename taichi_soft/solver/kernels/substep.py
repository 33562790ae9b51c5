"""One substep, phase by phase, in the order in which they run.

    each body              wind, external forces
                           internal forces, reactions of pins, grabs, motors
                           damping of vibrations
                           kick: new velocities
    its island             joints
                           contact: broad phase, narrow phase, solver
    each body              drift: new positions

Contact changes velocities before particles move. In the next substep, joints correct the effect of
contact on joined particles. A body alone in its island drifts in the same pass as its kick, and collides
afterwards.

Groups of fields: reads colliders, soft; writes islands.
"""

from taichi_soft.bodies.kernels.rigid import is_rigid
from taichi_soft.bodies.status import ACTIVE, JOINED
from taichi_soft.contact.fields import NO_CONTACT
from taichi_soft.contact.kernels.broad_phase import (
    begin_search,
    has_contact_pairs,
    is_outdated,
    search_body,
    update_displacement,
)
from taichi_soft.contact.kernels.contact_solver import solve_island
from taichi_soft.contact.kernels.narrow_phase import find_contacts
from taichi_soft.contact.kernels.touches import add_touches
from taichi_soft.control.kernels.drives import apply_external_forces, apply_wind
from taichi_soft.control.kernels.joints import solve_joints
from taichi_soft.control.kernels.motors import run_motors
from taichi_soft.core.runtime import ti
from taichi_soft.solver.kernels.attempts import begin_body
from taichi_soft.solver.kernels.body_end import end_body
from taichi_soft.solver.kernels.calming import calm_body, update_mean_speed
from taichi_soft.solver.kernels.drift import (
    begin_collisions,
    can_drift_at_once,
    drift_body,
    has_drifted,
    list_near_colliders,
)
from taichi_soft.solver.kernels.jobs import OWNER, run_job
from taichi_soft.solver.kernels.kick import kick_body
from taichi_soft.solver.kernels.vibration import damp_body, time_to_positions
from taichi_soft.solver.step_fields import Job

BEGIN, KICK, BOXES, BROAD_PHASE, NARROW_PHASE, DRIFT, END = range(7)
"""Phases that run separately for each body. BEGIN and END run once per step, all others once per substep."""

NONE, OUTDATED, VALID = range(3)
"""States of an island's contact candidates. NONE: no search yet in this step. OUTDATED: an attempt failed
after the search. VALID: the candidates can be used."""

MAX_IMPULSE_STEP = 0.1
"""Largest displacement by an impact in one substep, in mean edge lengths, that contact ignores when it looks
for further impacts. A body that is displaced more can strike another body in the same substep. A body that is
displaced less penetrates the other body by at most this distance, and contact moves it out again."""


@ti.func
def substep(state: ti.template(), program: ti.template(), island, now, run: ti.template()):
    """Run one substep of an island.

    Args:
        now: a `Moment`.
        run: a `Progress`, updated for the next substep.
    """
    drift_time = _kick_bodies(state, program, island, now, run)
    speed, impact_speed = _compare_speeds(state, island, now, run)
    if _has_drifted(state, island, now, run, drift_time) == 0:
        of_joints = solve_joints(state, island, now.h, int(now.since == 0.0), run.velocity)
        fastest = ti.max(speed, of_joints.x)
        _solve_contact(state, program, island, now, run, fastest, ti.max(impact_speed, of_joints.y))
        _drift_bodies(state, program, island, now, run, fastest)
    _check_shapes(state, program, island, now, run)


@ti.func
def _advance_body(state: ti.template(), program: ti.template(), body, job):
    """Run the phases of one body up to the kick: wind, external forces, internal forces, motors, damping,
    kick.
    """
    felt = program.integrator.felt_time(state.body_velocity_lag[body], job.h, job.s)
    apply_wind(state, body, job.h)
    apply_external_forces(state, body, program.integrator.drive_time(job.h, job.s, job.substeps))
    program.integrator.hold(state, program, body, job.h, felt)
    run_motors(state, body, job.h, felt, int(job.s == 0))
    if job.s == 0:
        update_mean_speed(state, body)
    damp_body(state, program, body, felt, job.h, job.s, job.substeps)
    calm_body(state, program, body, time_to_positions(program, felt, job.h), job.h, job.s, job.substeps)
    kick_body(state, program, body, job, felt)


@ti.func
def substep_alone(state: ti.template(), program: ti.template(), body, now):
    """Run one substep of one body among colliders, without other bodies, to find the cause of a failure."""
    job = Job(s=now.s, substeps=now.substeps, h=now.h, since=now.since, left=now.left)
    _advance_body(state, program, body, job)
    job.fastest = state.islands.body_speed[body]
    drift_body(state, body, job)


@ti.func
def do_phase(state: ti.template(), program: ti.template(), island, body, job):
    """Run one phase of one body. Any thread can call this."""
    if job.phase != KICK:
        _do_other_phase(state, program, island, body, job)
    elif state.body_status[body] == ACTIVE:
        _advance_body(state, program, body, job)


@ti.real_func
def _do_contact_phase(state: ti.template(), island: ti.i32, body: ti.i32, job: Job):
    """Run a phase of contact. LLVM vectorises the computation of gaps only in a separate function."""
    if job.phase == BOXES:
        begin_search(state, body, job.impact_speed, job.h, job.left, job.forgets)
    if job.phase == BROAD_PHASE:
        search_body(state, body, island)
    if job.phase == NARROW_PHASE:
        find_contacts(state, body, job.impact_speed, job.h)
        begin_collisions(state, body, job)


@ti.real_func
def _do_other_phase(state: ti.template(), program: ti.template(), island: ti.i32, body: ti.i32, job: Job):
    """Run any phase except the kick. This is a separate function, because Taichi's compile time grows faster
    than the length of a function.
    """
    if job.phase == BEGIN:
        begin_body(state, program, body)
    if job.phase == END:
        state.islands.has_failed[body] = end_body(state, program, body, job.substeps, job.h)
    if job.phase == DRIFT and state.body_status[body] == ACTIVE:
        drift_body(state, body, job)
    if ti.static(program.has_soft_contact):
        if job.phase == DRIFT and has_contact_pairs(state, island) == 1:
            update_displacement(state, body, job.shift)
        if job.phase == BOXES or job.phase == BROAD_PHASE or job.phase == NARROW_PHASE:
            _do_contact_phase(state, island, body, job)


@ti.func
def each_body(state: ti.template(), program: ti.template(), island, job):
    """Run a phase for every body of an island, and wait until all are finished."""
    run_job(state, program, do_phase, island, OWNER, job)


@ti.func
def _kick_bodies(state: ti.template(), program: ti.template(), island, now, run: ti.template()):
    """Kick the bodies of an island. Returns: the time for which the bodies have also drifted [s]."""
    body = state.islands.body[state.islands.first[island]]
    is_free = is_alone(state, program, island)
    if is_free == 1:
        if not (state.colliders.gone[body] + run.fastest * now.h <= state.colliders.reach[body]):
            list_near_colliders(state, body, run.fastest, now.since, now.left)
        is_free = can_drift_at_once(state, body, run.fastest * now.h)
    drift_time = now.h * ti.cast(is_free, ti.f32)
    has_pairs = 0
    if ti.static(program.has_soft_contact):
        has_pairs = has_contact_pairs(state, island)
    each_body(
        state,
        program,
        island,
        Job(
            phase=KICK,
            s=now.s,
            substeps=now.substeps,
            has_pairs=has_pairs,
            h=now.h,
            since=now.since,
            drift_time=drift_time,
            velocity=run.velocity,
        ),
    )
    return drift_time


@ti.func
def is_alone(state: ti.template(), program: ti.template(), island):
    """Return 1 if an island is one body that can touch only colliders, and the kick can move the body."""
    body = state.islands.body[state.islands.first[island]]
    bodies = state.islands.first[island + 1] - state.islands.first[island]
    drifts_at_once = int(ti.static(program.integrator.drifts_at_once))
    alone = drifts_at_once & int(bodies == 1) & int(state.body_drives[body] & JOINED == 0)
    if ti.static(state.capacity.contact.rigid):
        alone = alone & int(not is_rigid(state, body))
    if ti.static(program.has_soft_contact):
        alone = alone & (1 - has_contact_pairs(state, island))
    return alone


@ti.func
def _compare_speeds(state: ti.template(), island, now, run: ti.template()):
    """Combine the results of the bodies' kicks: speeds, and stability of the attempt.

    Returns: two speeds [m/s]. The first is the highest speed of a particle. The second is the speed that an
        impact can give a body, relative to the mean velocity of the island. It is 0 if a body would move by
        at most `MAX_IMPULSE_STEP` at this speed. It ignores exploding bodies, because they would cause a new
        search in every substep.
    """
    highest, striking = ti.cast(0.0, ti.f32), ti.cast(0.0, ti.f32)
    least_edge = ti.cast(NO_CONTACT, ti.f32)
    for i in range(state.islands.first[island], state.islands.first[island + 1]):
        body = state.islands.body[i]
        if state.body_status[body] == ACTIVE:
            highest = ti.max(highest, state.islands.body_speed[body])
            if state.islands.is_exploding[body] == 0:
                striking = ti.max(striking, 2.0 * state.islands.body_mean_beside[body])
            run.is_stable = run.is_stable & state.islands.is_stable[body]
        least_edge = ti.min(least_edge, state.body_edge[body])
    run.fastest = highest
    return highest, ti.select(striking * now.h > MAX_IMPULSE_STEP * least_edge, striking, 0.0)


@ti.func
def _has_drifted(state: ti.template(), island, now, run: ti.template(), drift_time):
    """If the kick has moved the body of an island, collide the body. Returns: 1 if the body has drifted."""
    has_moved = 0
    body = state.islands.body[state.islands.first[island]]
    if drift_time > 0.0 and state.body_status[body] == ACTIVE:
        has_moved = has_drifted(state, body, run.fastest, now.h, now.since)
    return has_moved


@ti.func
def _solve_contact(
    state: ti.template(), program: ti.template(), island, now, run: ti.template(), fastest, impact_speed
):
    """Find the contacts between the bodies of an island, and apply their impulses.

    If the candidates are outdated, search for new candidates first.
    """
    if ti.static(program.has_soft_contact):
        if has_contact_pairs(state, island) == 1:
            if run.candidates != VALID or is_outdated(state, island, impact_speed, now.h) == 1:
                run.shift = ti.Vector.zero(ti.f32, 3)
                forgets = int(run.candidates != NONE)
                each_body(
                    state,
                    program,
                    island,
                    Job(phase=BOXES, h=now.h, left=now.left, impact_speed=impact_speed, forgets=forgets),
                )
                each_body(state, program, island, Job(phase=BROAD_PHASE))
            each_body(
                state,
                program,
                island,
                Job(
                    phase=NARROW_PHASE,
                    h=now.h,
                    since=now.since,
                    left=now.left,
                    fastest=fastest,
                    impact_speed=impact_speed,
                ),
            )
            solve_island(state, island, now.h)
            if state.soft.records_touches[None] == 1:
                add_touches(state, island)
    run.candidates = VALID


@ti.func
def _drift_bodies(state: ti.template(), program: ti.template(), island, now, run: ti.template(), fastest):
    run.shift += now.h * run.velocity
    each_body(
        state,
        program,
        island,
        Job(phase=DRIFT, h=now.h, since=now.since, left=now.left, fastest=fastest, shift=run.shift),
    )


@ti.func
def _check_shapes(state: ti.template(), program: ti.template(), island, now, run: ti.template()):
    """Mark the attempt as unstable if the integrator rejects the new shape of a body."""
    for i in range(state.islands.first[island], state.islands.first[island + 1]):
        body = state.islands.body[i]
        if state.body_status[body] == ACTIVE:
            run.is_stable = run.is_stable & program.integrator.check(state, body, now.h, now.is_last)
