"""One fixed step of the schedule `per_body`: one or more attempts, each of many substeps.

One thread runs all substeps of an island, and islands run in parallel. Threads do not wait between substeps,
and the data of a body stay in one core's cache. An island is a group of bodies that can touch in the step or
are joined. Idle threads help with islands of several bodies (`jobs.py`). The result does not depend on the
number of threads.

Long steps are split over several kernel calls, so that Ctrl-C works between them. In each call, islands
continue where they stopped.

Groups of fields: reads islands.
"""

from taichi_soft.bodies.kernels.particles import gravity_on, highest_speed
from taichi_soft.bodies.status import ACTIVE
from taichi_soft.contact.kernels.parting import find_overlaps, part_bodies
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti
from taichi_soft.solver.kernels.attempts import (
    attempts_of,
    island_is_valid,
    refined_substeps,
    restore_island,
    set_strong_damping,
)
from taichi_soft.solver.kernels.islands import enter_island, find_islands, leave_island
from taichi_soft.solver.kernels.jobs import close_shared_island, help_others, open_shared_islands
from taichi_soft.solver.kernels.settling import settle_island
from taichi_soft.solver.kernels.sleep import update_sleep, wake_by_colliders, wake_island
from taichi_soft.solver.kernels.substep import (
    BEGIN,
    END,
    NONE,
    OUTDATED,
    do_phase,
    each_body,
    is_alone,
    substep,
)
from taichi_soft.solver.step_fields import Job, Moment, Progress

ALL_SLEEP = -1
"""Result of `step_islands` if no body is awake. Another step would then change nothing."""

UNFINISHED = -2
"""Result of `step_islands` if the step needs further calls."""

DONE = -1
"""Value of `Progress.attempt` for an island that has completed the step."""


@ti.func
def fixed_step(state: ti.template(), program: ti.template(), island, substeps, h, most, goes_on):
    """Run one fixed step of an island, but at most `most` substeps in this call.

    Returns: number of failed bodies, or UNFINISHED; and 1 if the island is awake.
    """
    if goes_on == 0:
        _begin(state, program, island)
    run, left = state.progress[island], most
    halvings, last = attempts_of(state, program)
    least = refined_substeps(state, program, island, substeps, substeps * h)
    longest = h if least == substeps else substeps * h / least
    finer, is_good = 1, 0
    while run.attempt != DONE and is_good == 0 and left > 0:
        finer = 1 << ti.min(run.attempt, halvings)
        count, first = finer * least, run.s
        end = ti.min(first + left, count)
        if first == 0:
            _begin_attempt(state, program, island, substeps * h, run)
        is_last = int(run.attempt == last)
        _make_substeps(state, program, island, end, count, longest / finer, is_last, run)
        left -= run.s - first
        if is_last == 0 and run.is_stable == 0:
            _restore(state, program, island, run, halvings)
        elif run.s == count:
            if (is_last | island_is_valid(state, island)) == 1:
                is_good = 1
            else:
                _restore(state, program, island, run, halvings)
    if is_good == 1:
        _end(state, program, island, run, finer * least, longest / finer)
        settle_island(state, island, substeps * h)
        run.is_awake = update_sleep(state, island, substeps * h)  # puts resting islands to sleep
    state.progress[island] = run
    return ti.select(run.attempt == DONE, run.failed, UNFINISHED), run.is_awake


@ti.func
def _begin(state: ti.template(), program: ti.template(), island):
    """If a body of the island is awake, wake its other bodies, and save the state of all bodies."""
    is_awake = wake_island(state, island)
    if is_awake == 1:
        enter_island(state, island)
        each_body(state, program, island, Job(phase=BEGIN))
        if ti.static(program.has_soft_contact):
            find_overlaps(state, island)
    attempt = ti.select(is_awake == 1, 0, DONE)
    state.progress[island] = Progress(attempt=attempt, is_stable=1, is_awake=is_awake, candidates=NONE)


@ti.func
def _begin_attempt(state: ti.template(), program: ti.template(), island, dt, run: ti.template()):
    if is_alone(state, program, island) == 1:
        body = state.islands.body[state.islands.first[island]]
        # Add the speed that gravity can add, so that near colliders are listed only once per step.
        run.fastest = highest_speed(state, body) + dt * gravity_on(state, body).norm()
    elif ti.static(program.has_soft_contact):
        run.velocity = _mean_velocity(state, island)


@ti.func
def _make_substeps(
    state: ti.template(), program: ti.template(), island, end, count, h, is_last, run: ti.template()
):
    """Run the substeps of an attempt up to `end`. Stop after a substep that turns out to be too long.

    The attempt has `count` substeps of `h` [s].
    """
    while run.s < end and (run.is_stable | is_last) == 1:
        s = run.s
        now = Moment(s=s, substeps=count, is_last=is_last, h=h, since=s * h, left=h * (count - s))
        substep(state, program, island, now, run)
        run.s = s + 1


@ti.func
def _mean_velocity(state: ti.template(), island):
    """Return the mean velocity of an island's particles [m/s]; zero if a body of the island does not move.

    Contact uses speeds relative to this velocity: motion that all bodies share brings no two bodies closer.
    """
    total, count, moves = ti.Vector.zero(ti.f32, 3), 0, ti.cast(1.0, ti.f32)
    for i in range(state.islands.first[island], state.islands.first[island + 1]):
        body = state.islands.body[i]
        if state.body_status[body] == ACTIVE:
            particles = state.body_particles[body]
            p = particles[0]
            while p < particles[1]:
                total += state.particle_velocity[p]
                p = row_behind(p)
            count += particles[1] - particles[0]
        else:
            moves = 0.0
    return moves * total / ti.max(count, 1)


@ti.func
def _restore(state: ti.template(), program: ti.template(), island, run: ti.template(), halvings):
    """Restore an island, and prepare its next attempt."""
    restore_island(state, program, island)
    run.attempt += 1
    run.s, run.is_stable, run.candidates = 0, 1, OUTDATED
    run.fastest, run.shift = 0.0, ti.Vector.zero(ti.f32, 3)
    if run.attempt > halvings:
        set_strong_damping(state, island, 1)


@ti.func
def _end(state: ti.template(), program: ti.template(), island, run: ti.template(), substeps, h):
    """End the step of each body, and freeze invalid bodies."""
    failed = 0
    each_body(state, program, island, Job(phase=END, substeps=substeps, h=h))
    row = state.islands.first[island]
    while row < state.islands.first[island + 1]:
        failed += state.islands.has_failed[state.islands.body[row]]
        row = row_behind(row)
    if ti.static(program.has_soft_contact):
        part_bodies(state, island, substeps * h)
    leave_island(state, island)
    set_strong_damping(state, island, 0)
    run.attempt, run.failed = DONE, failed


@ti.kernel
def step_islands(
    state: ti.template(),
    program: ti.template(),
    body_count: ti.i32,
    helpers: ti.i32,
    substeps: ti.i32,
    h: ti.f32,
    most: ti.i32,
    goes_on: ti.i32,
) -> ti.i32:
    """Run one fixed step of every active body, but at most `most` substeps of each island in this call.

    Args:
        helpers: number of threads that can help other threads with their islands.
        goes_on: 1 to continue an unfinished step.
    Returns: number of failed bodies, `ALL_SLEEP`, or `UNFINISHED`. After `UNFINISHED`, call this again with
        `goes_on` = 1.
    """
    failed, awake, unfinished = 0, 0, 0
    ti.loop_config(serialize=True)
    for _ in range(1):
        if goes_on == 0:
            wake_by_colliders(state, body_count)
            if ti.static(program.has_soft_contact):
                find_islands(state, body_count, substeps * h)
        open_shared_islands(state, helpers)
    ti.loop_config(block_dim=1)
    for i in range(state.islands.count[None] + helpers):
        if i < state.islands.count[None]:
            failed_here, is_awake = fixed_step(state, program, i, substeps, h, most, goes_on)
            failed += ti.max(failed_here, 0)
            awake += is_awake
            unfinished += int(failed_here == UNFINISHED)
            close_shared_island(state, i)
        else:
            help_others(state, program, do_phase, i - state.islands.count[None])
    found = ti.select(failed + awake == 0, ALL_SLEEP, failed)
    return ti.select(unfinished > 0, UNFINISHED, found)
