"""How threads share an island: phase by phase, each thread takes bodies until none is left.

    thread 0                              thread 1                       thread 2
    owns island 0 of bodies a b c d       owns island 1 of body e        owns none: helper 1
    ----------------------------------    ---------------------------    ----------------------
    calls for KICK
    kick a, kick b                        kick e                         kick c, kick d
    waits for c and d
    solves joints of a b c d              joints, contact, drift of e    looks for bodies
    calls for NARROW_PHASE
    gaps of a, b                          next substep                   gaps of c, d
    solves contacts of a b c d            ...                            looks for bodies
    calls for DRIFT
    ...                                   has no island left: helper 2   ...

An island of several bodies is a *shared island*. One thread *owns* it. The owner does what passes between
its bodies, and calls for a *job*: a phase that each of them makes by itself. *Helpers* are threads that own
no island, or none any more. They take bodies of a job that nobody has taken yet, and so does the owner. The
owner then waits for the bodies that others took. Nobody waits for a thread that has not begun: where none is
free the owner takes all bodies itself. What becomes of a body does not depend on which thread took it.
"""

from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti
from taichi_soft.solver.step_fields import MOST_PARTS, Job

OWNER = 0
"""Number of the worker that owns an island; its helpers are numbered on."""

HELP = -1
"""Instead of a phase: whatever the owner has called for."""


@ti.func
def _now(counter: ti.template()):
    """What a counter is that other threads change.

    A maximum with -1 changes nothing that matters; it cannot be optimised into a plain load.
    """
    return ti.atomic_max(counter, -1)


@ti.func
def _size_of(state: ti.template(), island):
    """Bodies of an island."""
    return state.contact.island_first[island + 1] - state.contact.island_first[island]


@ti.func
def is_shared_island(state: ti.template(), island):
    """Whether an island has several bodies, so that other threads may help with it."""
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
    """Take bodies of an island until none is waiting. The owner calls for a job first, and waits for all.

    Each worker begins with its own part of the bodies, and takes from those of others when that is done: what
    a body reads and writes then stays in the cache of one core from phase to phase.

    What is called for is written here, because to Taichi no call reads what was written before it: it drops
    what is written again before the kernel itself reads it. A body alone is nobody else's business: what its
    thread wrote here would take the cache line from those of its neighbours.

    Args:
        do_phase: a function (state, program, island, body, job).
        worker: OWNER, or a helper's number; the owner alone may call for any phase but HELP.
    """
    first, count = state.contact.island_first[island], _size_of(state, island)
    called = job
    is_shared = int(count > 1)
    parts, rows = 1, state.contact.island_body.shape[0]
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
            do_phase(state, program, island, state.contact.island_body[before + place], called)
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
    """Before the islands are stepped: what there is to help with."""
    islands, members, island = 0, 0, 0
    while island < state.contact.island_count[None]:
        if is_shared_island(state, island):
            islands += 1
            members += _size_of(state, island)
        island = row_behind(island)
    state.jobs.parts[None] = ti.min(helpers + 1, MOST_PARTS)
    state.jobs.unfinished_islands[None] = islands
    state.jobs.useful_helpers[None] = members - islands


@ti.func
def close_shared_island(state: ti.template(), island):
    """After the step of an island: its helpers may look elsewhere."""
    if is_shared_island(state, island):
        ti.atomic_sub(state.jobs.unfinished_islands[None], 1)


@ti.func
def help_others(state: ti.template(), program: ti.template(), do_phase: ti.template(), helper):
    """Work on shared islands until all are finished, as one of the first helpers; others would only be in the
    way."""
    while helper < state.jobs.useful_helpers[None] and _now(state.jobs.unfinished_islands[None]) > 0:
        for island in range(state.contact.island_count[None]):
            if is_shared_island(state, island):
                run_job(state, program, do_phase, island, helper + 1, Job(phase=HELP))
