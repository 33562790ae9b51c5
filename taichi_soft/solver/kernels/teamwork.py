"""Bodies of an island shared among threads, one task after the other.

One thread owns an island: it does what passes between bodies, and calls for what each body does by itself.
Threads without an island of their own take bodies where some are waiting, and where no thread is free the
owner takes them all. It waits for bodies which others have taken, and those are at work on them; nobody waits
for a thread that has not begun. What becomes of a body does not depend on who took it.
"""

from taichi_soft.bodies.status import ACTIVE
from taichi_soft.contact.fields import MOST_PARTS
from taichi_soft.contact.kernels.soft_gaps import find_gaps
from taichi_soft.contact.kernels.soft_search import begin_search, is_social, note_way, search_body
from taichi_soft.core.runtime import ti
from taichi_soft.solver.kernels.contact_body import begin_body, finish_body
from taichi_soft.solver.kernels.contact_substep import drift_body, push_body

OWNER = 0
"""Number of the worker that owns an island; its helpers are numbered on."""

HELP = -1
"""Whatever its owner has called for."""

BEGIN, PUSH, BOXES, SEARCH, GAPS, DRIFT, FINISH = range(7)
"""Tasks. Their numbers: none; h, since, way, length of the step; given, h, left, forgets; none; given, h; h,
since, left and fastest; substeps, h. What an island shares is a velocity [m/s] in the push, and in the drift
a way [m]."""


@ti.func
def _now(counter: ti.template()):
    """What a counter is that other threads change.

    A maximum with -1 changes nothing that matters; it cannot be optimised into a plain load.
    """
    return ti.atomic_max(counter, -1)


@ti.real_func
def _do_contact_task(
    state: ti.template(),
    program: ti.template(),
    island: ti.i32,
    body: ti.i32,
    task: ti.i32,
    numbers: ti.math.vec4,
    common: ti.math.vec3,
):
    """All tasks but the push; by itself, because Taichi takes more than twice as long for twice the code."""
    if task == BEGIN:
        begin_body(state, program, body)
    if task == FINISH:
        finish_body(state, program, body, ti.cast(ti.round(numbers[0]), ti.i32), numbers[1])
    if task == DRIFT and state.body_status[body] == ACTIVE:
        drift_body(state, body, numbers[0], numbers[1], numbers[2], numbers[3])
    if ti.static(program.has_soft_contact):
        if task == DRIFT and is_social(state, island) == 1:
            note_way(state, body, common)
        if task == BOXES:
            begin_search(state, body, numbers[0], numbers[1], numbers[2], numbers[3])
        if task == SEARCH:
            search_body(state, body, island)
        if task == GAPS:
            find_gaps(state, body, numbers[0], numbers[1])


@ti.func
def _do_task(state: ti.template(), program: ti.template(), island, body, task, numbers, common):
    if task != PUSH:
        _do_contact_task(state, program, island, body, task, numbers, common)
    elif state.body_status[body] == ACTIVE:
        push_body(state, program, body, numbers[0], numbers[1], numbers[2], numbers[3], common)


@ti.func
def _size_of(state: ti.template(), island):
    """Bodies of an island."""
    return state.contact.island_first[island + 1] - state.contact.island_first[island]


@ti.func
def is_crowd(state: ti.template(), island):
    """Whether an island has several bodies, and is worth helping with."""
    return _size_of(state, island) > 1


@ti.real_func
def work_on(
    state: ti.template(),
    program: ti.template(),
    island: ti.i32,
    worker: ti.i32,
    task: ti.i32,
    numbers: ti.math.vec4,
    common: ti.math.vec3,
):
    """Take bodies of an island until none is waiting. The owner calls for a task first, and waits for all.

    Each worker begins with its own part of the bodies, and takes from those of others when that is done: what
    a body reads and writes then stays in the cache of one core from task to task.

    What is called for is written here, because to Taichi no call reads what was written before it: it drops
    what is written again before the kernel itself reads it. A body alone is nobody else's business: what its
    thread wrote here would take the cache line from those of its neighbours.

    Args:
        worker: OWNER, or a helper's number; the owner alone may call for anything but HELP.
    """
    first, count = state.contact.island_first[island], _size_of(state, island)
    what, how, velocity = task, numbers, common
    is_shared = int(count > 1)
    parts, rows = 1, state.contact.island_body.shape[0]
    if is_shared == 1:
        parts = state.contact.parts[None]
        if task != HELP:
            state.contact.task[island] = task
            state.contact.task_numbers[island] = numbers
            state.contact.task_common[island] = common
            state.contact.unfinished[island] = count
            for part in range(parts):
                size = count * (part + 1) // parts - count * part // parts
                ti.atomic_max(state.contact.untaken[part * rows + island], size)
    for turn in range(parts):
        part = (worker + turn) % parts
        row, place, done = part * rows + island, 1 - is_shared, 0
        before = first + count * part // parts - 1
        if is_shared == 0:
            before = first - 1
        elif _now(state.contact.untaken[row]) > 0:
            place = ti.atomic_sub(state.contact.untaken[row], 1)
        while place > 0:
            if task == HELP:
                what, how = state.contact.task[island], state.contact.task_numbers[island]
                velocity = state.contact.task_common[island]
            _do_task(state, program, island, state.contact.island_body[before + place], what, how, velocity)
            done += 1
            place = 0
            if is_shared == 1:
                place = ti.atomic_sub(state.contact.untaken[row], 1)
        if is_shared == 1 and done > 0:
            ti.atomic_sub(state.contact.unfinished[island], done)
    if is_shared == 1 and task != HELP:
        while _now(state.contact.unfinished[island]) > 0:
            pass


@ti.func
def open_crowds(state: ti.template(), helpers):
    """Before the islands are stepped: what there is to help with."""
    crowds, members = 0, 0
    for island in range(state.contact.island_count[None]):
        if is_crowd(state, island):
            crowds += 1
            members += _size_of(state, island)
    state.contact.parts[None] = ti.min(helpers + 1, MOST_PARTS)
    state.contact.unfinished_crowds[None] = crowds
    state.contact.useful_helpers[None] = members - crowds


@ti.func
def help_others(state: ti.template(), program: ti.template(), helper):
    """Work on crowds until all are finished, as one of the first helpers; others would only be in the way."""
    nothing = ti.Vector.zero(ti.f32, 4)
    while helper < state.contact.useful_helpers[None] and _now(state.contact.unfinished_crowds[None]) > 0:
        for island in range(state.contact.island_count[None]):
            if is_crowd(state, island):
                work_on(state, program, island, helper + 1, HELP, nothing, nothing.xyz)
