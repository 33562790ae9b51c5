"""Share islands between threads: in each phase, threads take bodies until none is left.

    thread 0                              thread 1                       thread 2
    owns island 0 of bodies a b c d       owns island 1 of body e        owns none: helper 1
    ----------------------------------    ---------------------------    ----------------------
    starts KICK
    kick a, kick b                        kick e                         kick c, kick d
    waits for c and d
    solves joints of a b c d              joints, contact, drift of e    looks for bodies
    starts NARROW_PHASE
    gaps of a, b                          next substep                   gaps of c, d
    solves contacts of a b c d            ...                            looks for bodies
    starts DRIFT
    ...                                   has no island left: helper 2   ...

An island of several bodies is a *shared island*. One thread *owns* it. The owner solves joints and contacts
between its bodies, and starts *jobs*: phases that run separately for each body. *Helpers* are threads that
own no island, or have finished their islands. Owner and helpers take bodies that no thread has taken yet. The
owner then waits for the bodies that helpers took. The owner never waits for a thread that has not started:
without helpers, the owner takes all bodies. The result for a body does not depend on the thread.

Groups of fields: reads islands; writes jobs.
"""

from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti
from taichi_soft.solver.step_fields import MOST_PARTS, Job

OWNER = 0
"""Worker number of the thread that owns an island. Helpers have larger numbers."""

HELP = -1
"""Value of `Job.phase` for a helper. It means the phase that the owner of the island has started."""


@ti.func
def _now(counter: ti.template()):
    """Read a counter that other threads change.

    A maximum with -1 does not change the counter, but the compiler cannot turn it into a plain load.
    """
    return ti.atomic_max(counter, -1)


@ti.func
def _size_of(state: ti.template(), island):
    """Return the number of bodies of an island."""
    return state.islands.first[island + 1] - state.islands.first[island]


@ti.func
def is_shared_island(state: ti.template(), island):
    """True if an island has several bodies, so that helpers can take some."""
    return _size_of(state, island) > 1


@ti.real_func
def run_job(
    state: ti.template(),
    program: ti.template(),
    do_phase: ti.template(),
    island: ti.i32,
    worker: ti.i32,
    job: Job,
):
    """Take bodies of an island until none is left. The owner first starts the job, and at the end waits until
    all bodies are finished.

    Each worker begins with its own part of the bodies, and then takes bodies from the parts of other workers.
    So the data of a body stay in the cache of one core.

    This function stores the job, because Taichi would drop the write if a called function stored it: Taichi
    assumes that called functions do not read earlier writes, and drops writes that are overwritten unread.
    Islands with one body are not shared between threads, because writing their jobs would invalidate cache
    lines of other threads.

    Args:
        do_phase: a function (state, program, island, body, job).
        worker: OWNER, or a helper's number; only the owner can start a phase other than HELP.
    """
    first, count = state.islands.first[island], _size_of(state, island)
    called = job
    is_shared = int(count > 1)
    parts, rows = 1, state.islands.body.shape[0]
    if is_shared == 1:
        parts = state.jobs.parts[None]
        if job.phase != HELP:
            state.jobs.job[island] = job
            state.jobs.unfinished[island] = count
            for part in range(parts):
                size = count * (part + 1) // parts - count * part // parts
                ti.atomic_max(state.jobs.untaken[part * rows + island], size)
    for turn in range(parts):
        part = (worker + turn) % parts
        row, place, done = part * rows + island, 1 - is_shared, 0
        before = first + count * part // parts - 1
        if is_shared == 0:
            before = first - 1
        elif _now(state.jobs.untaken[row]) > 0:
            place = ti.atomic_sub(state.jobs.untaken[row], 1)
        while place > 0:
            if job.phase == HELP:
                called = state.jobs.job[island]
            do_phase(state, program, island, state.islands.body[before + place], called)
            done += 1
            place = 0
            if is_shared == 1:
                place = ti.atomic_sub(state.jobs.untaken[row], 1)
        if is_shared == 1 and done > 0:
            ti.atomic_sub(state.jobs.unfinished[island], done)
    if is_shared == 1 and job.phase != HELP:
        while _now(state.jobs.unfinished[island]) > 0:
            pass


@ti.func
def open_shared_islands(state: ti.template(), helpers):
    """Count the shared islands, and the helpers that can work on them. Call this before the step."""
    islands, members, island = 0, 0, 0
    while island < state.islands.count[None]:
        if is_shared_island(state, island):
            islands += 1
            members += _size_of(state, island)
        island = row_behind(island)
    state.jobs.parts[None] = ti.min(helpers + 1, MOST_PARTS)
    state.jobs.unfinished_islands[None] = islands
    state.jobs.useful_helpers[None] = members - islands


@ti.func
def close_shared_island(state: ti.template(), island):
    """Release the helpers of an island after its step."""
    if is_shared_island(state, island):
        ti.atomic_sub(state.jobs.unfinished_islands[None], 1)


@ti.func
def help_others(state: ti.template(), program: ti.template(), do_phase: ti.template(), helper):
    """Work on shared islands until all islands are finished.

    Only the first `useful_helpers` helpers work, because more helpers would slow the work down.
    """
    while helper < state.jobs.useful_helpers[None] and _now(state.jobs.unfinished_islands[None]) > 0:
        for island in range(state.islands.count[None]):
            if is_shared_island(state, island):
                run_job(state, program, do_phase, island, helper + 1, Job(phase=HELP))
