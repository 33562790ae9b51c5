"""Schedule `per_body` where bodies touch more than the floor: one thread makes all substeps of an island,
and threads that have nothing else to do help it.

A substep goes in the order velocity, joints, contact, position: contact takes velocities away before they
move anything, and what it changes of joints they make good in the next substep.

Substeps are chosen for small deformation; an impact faster than sound flattens tetrahedra, which are stiffer
then. Where a step ends non-finite, or forces changed a velocity by more than `JOLT` at once, the island
is put back to where it was, and makes the step again with twice as many substeps, and so on, as a body alone
does in `per_body`.
"""

from taichi_soft.bodies.status import ACTIVE, JOINED
from taichi_soft.contact.fields import NO_CONTACT
from taichi_soft.contact.kernels.collide import forget_contacts
from taichi_soft.contact.kernels.rebound import take_back_rebounds
from taichi_soft.contact.kernels.soft_contact import solve_island
from taichi_soft.contact.kernels.soft_search import forget_candidates, is_outdated, is_social
from taichi_soft.contact.kernels.touches import add_touches, forget_touches
from taichi_soft.control.kernels.joints import solve_joints
from taichi_soft.core.runtime import ti
from taichi_soft.core.types import Integrator
from taichi_soft.solver.kernels.contact_substep import has_drifted, is_clear
from taichi_soft.solver.kernels.implicit_euler import MOST_PIECES, keeps_shape
from taichi_soft.solver.kernels.islands import find_islands
from taichi_soft.solver.kernels.per_body import (
    DONE,
    UNFINISHED,
    body_is_sound,
    fineness,
    last_attempt,
    put_back_body,
)
from taichi_soft.solver.kernels.sleep import settle_island, wake_by_colliders, wake_island
from taichi_soft.solver.kernels.teamwork import (
    BEGIN,
    BOXES,
    DRIFT,
    FINISH,
    GAPS,
    OWNER,
    PUSH,
    SEARCH,
    help_others,
    is_crowd,
    open_crowds,
    work_on,
)

ALL_SLEEP = -1
"""Instead of a number of bodies: none is awake, and the next step would find all as it is."""

NONE, OUTDATED, VALID = range(3)
"""Candidates of an island: the last step has forgotten its own; those of an attempt at this one; usable."""

BLOW = 0.1
"""Mean edges within a substep from which a body that is struck may strike the next one in the same substep.
Less far it may go into that, and is put out of it again."""


@ti.func
def _take_back(state: ti.template(), program: ti.template(), island):
    """Put an island back to where it was before the step."""
    for i in range(state.contact.island_first[island], state.contact.island_first[island + 1]):
        body = state.contact.island_body[i]
        put_back_body(state, body)
        particles = state.body_particles[body]
        if ti.static(state.capacity.implicit):
            for p in range(particles[0], particles[1]):
                state.particle_contact[p] = state.prev_contact[p]
        take_back_rebounds(state, body)
        forget_contacts(state, body)
        if ti.static(program.has_soft_contact):
            forget_candidates(state, body)  # for good, as the island looks for others before it goes on
    if ti.static(program.has_soft_contact):
        forget_touches(state, island)


@ti.func
def _brake(state: ti.template(), island, is_braked):
    """Brake the vibrations of all that is in an island sharply (1), or no longer (0)."""
    for i in range(state.contact.island_first[island], state.contact.island_first[island + 1]):
        state.body_is_braked[state.contact.island_body[i]] = is_braked


@ti.func
def _island_is_sound(state: ti.template(), island):
    """Whether all that moves in an island can still be computed with (1)."""
    sound = 1
    for i in range(state.contact.island_first[island], state.contact.island_first[island + 1]):
        body = state.contact.island_body[i]
        if state.body_status[body] == ACTIVE:
            sound = sound & body_is_sound(state, body)
    return sound


@ti.func
def _is_alone(state: ti.template(), program: ti.template(), island):
    """Whether nothing but colliders can touch what is in an island (1); by implicit Euler, never."""
    body = state.contact.island_body[state.contact.island_first[island]]
    bodies = state.contact.island_first[island + 1] - state.contact.island_first[island]
    is_explicit = ti.static(program.integrator != Integrator.IMPLICIT_EULER)
    alone = int(is_explicit) & int(bodies == 1) & int(state.body_drives[body] & JOINED == 0)
    if ti.static(program.has_soft_contact):
        alone = alone & (1 - is_social(state, island))
    return alone


@ti.func
def _touch_each_other(
    state: ti.template(), program: ti.template(), island, candidates, shared, given, h, left
):
    """Contact between bodies of one island in a substep; looks for candidates again where they have aged.

    Args:
        candidates: NONE, OUTDATED or VALID.
        shared: way [m] that all of the island have gone since these were looked for.
        given: speed [m/s] that joints gave, or that others may give, beside what all have in common.
        left: time until the end of the step [s].
    Returns: `shared` as it is now.
    """
    shared_now = shared
    if is_social(state, island) == 1:
        nothing = ti.Vector.zero(ti.f32, 4)
        if candidates != VALID or is_outdated(state, island, given, h) == 1:
            shared_now = nothing.xyz
            forgets = ti.cast(candidates != NONE, ti.f32)
            work_on(state, program, island, OWNER, BOXES, ti.Vector([given, h, left, forgets]), nothing.xyz)
            work_on(state, program, island, OWNER, SEARCH, nothing, nothing.xyz)
        work_on(state, program, island, OWNER, GAPS, ti.Vector([given, h, 0.0, 0.0]), nothing.xyz)
        solve_island(state, island, h)
        if state.soft.records_touches[None] == 1:
            add_touches(state, island)
    return shared_now


@ti.func
def _end_substep(
    state: ti.template(),
    program: ti.template(),
    island,
    h,
    since,
    left,
    fastest,
    striking,
    common,
    candidates,
    shared,
):
    """What joints and contact make of new velocities, and the new positions.

    Args:
        since, left: time since the start of the step, and until its end [s].
        fastest, striking: highest speed in the island, and that which a body may give to another [m/s].
        common: velocity that its bodies share [m/s].
        candidates, shared: as `_touch_each_other` takes them.
    Returns: `shared` after the substep.
    """
    held, held_beside = ti.cast(0.0, ti.f32), ti.cast(0.0, ti.f32)
    if ti.static(program.integrator != Integrator.IMPLICIT_EULER):
        held, held_beside = solve_joints(state, island, h, int(since == 0.0), common)
    way = shared
    if ti.static(program.has_soft_contact):
        given = ti.max(striking, held_beside)
        way = _touch_each_other(state, program, island, candidates, shared, given, h, left)
    way += h * common
    numbers = ti.Vector([h, since, left, ti.max(fastest, held)])
    work_on(state, program, island, OWNER, DRIFT, numbers, way)
    return way


@ti.func
def _compare_speeds(state: ti.template(), island, h):
    """After the push: what the bodies of an island have noted.

    Returns: the highest speed [m/s]; that which a body may give to another that it strikes, beside what they
    share; and whether no force moved a particle too far at once (1). What explodes is not counted in the
    second: others would be searched again and again because of it.
    """
    highest, striking, is_gentle = ti.cast(0.0, ti.f32), ti.cast(0.0, ti.f32), 1
    least_edge = ti.cast(NO_CONTACT, ti.f32)
    for i in range(state.contact.island_first[island], state.contact.island_first[island + 1]):
        body = state.contact.island_body[i]
        if state.body_status[body] == ACTIVE:
            highest = ti.max(highest, state.contact.body_speed[body])
            if state.contact.is_wild[body] == 0:
                striking = ti.max(striking, 2.0 * state.contact.body_mean_beside[body])
            is_gentle = is_gentle & state.contact.is_gentle[body]
        least_edge = ti.min(least_edge, state.body_edge[body])
    return highest, ti.select(striking * h > BLOW * least_edge, striking, 0.0), is_gentle


@ti.func
def _common_velocity(state: ti.template(), island):
    """Mean velocity of the particles of an island [m/s]: what its bodies share brings none nearer.

    Zero where one of them does not move.
    """
    total, count, moves = ti.Vector.zero(ti.f32, 3), 0, ti.cast(1.0, ti.f32)
    for i in range(state.contact.island_first[island], state.contact.island_first[island + 1]):
        body = state.contact.island_body[i]
        if state.body_status[body] == ACTIVE:
            particles = state.body_particles[body]
            for p in range(particles[0], particles[1]):
                total += state.particle_velocity[p]
            count += particles[1] - particles[0]
        else:
            moves = 0.0
    return moves * total / ti.max(count, 1)


@ti.func
def _move_island(
    state: ti.template(),
    program: ti.template(),
    island,
    substeps,
    h,
    begin,
    end,
    candidates_before,
    way_before,
    fastest_before,
    common,
):
    """Substeps from `begin` to before `end`, of so many in an attempt of an island that is awake.

    Args:
        candidates_before, way_before, fastest_before: as returned for the substeps before these.
        common: velocity that its bodies shared before the attempt [m/s].
    Returns: whether forces moved no particle too far at once (1); state of the candidates, way [m] that all
        have gone since these were looked for, and highest speed [m/s].
    """
    first, last = state.contact.island_first[island], state.contact.island_first[island + 1]
    first_body = state.contact.island_body[first]
    is_gentle, candidates, shared, fastest = 1, candidates_before, way_before, fastest_before
    is_alone = _is_alone(state, program, island)
    for s in range(begin, end):
        since, left = s * h, h * (substeps - s)
        way = h * ti.cast(is_alone & is_clear(state, first_body, fastest * h), ti.f32)
        work_on(state, program, island, OWNER, PUSH, ti.Vector([h, since, way, h * substeps]), common)
        fastest, striking, gently = _compare_speeds(state, island, h)
        is_gentle = is_gentle & gently
        has_moved = 0
        if way > 0.0 and state.body_status[first_body] == ACTIVE:
            has_moved = has_drifted(state, first_body, fastest, h)
        if has_moved == 0:
            shared = _end_substep(
                state,
                program,
                island,
                h,
                since,
                left,
                fastest,
                striking,
                common,
                candidates,
                shared,
            )
            candidates = VALID
        if ti.static(program.integrator == Integrator.IMPLICIT_EULER):
            for i in range(first, last):
                body = state.contact.island_body[i]
                if state.body_status[body] == ACTIVE:
                    is_gentle = is_gentle & int(keeps_shape(state, body))
    return is_gentle, candidates, shared, fastest


@ti.func
def _step_awake_island(state: ti.template(), program: ti.template(), island, substeps, h, most):
    """One fixed step of an island, as fine as it needs, or the next `most` substeps of it.

    Returns: how many of its bodies failed, or UNFINISHED.
    """
    first, last = state.contact.island_first[island], state.contact.island_first[island + 1]
    nothing = ti.Vector.zero(ti.f32, 4)
    retries, last_one = state.retries[None], last_attempt(state.retries[None])
    if ti.static(program.integrator == Integrator.IMPLICIT_EULER):
        retries = ti.static(MOST_PIECES.bit_length() - 1)
        last_one = retries
    attempt, s, is_gentle, candidates = state.contact.island_pause[island]
    way, fastest = state.contact.island_way[island], state.contact.island_speed[island]
    common = state.contact.island_common[island]
    finer, is_open, left = 1, 1, most
    while is_open == 1 and left > 0:
        finer = fineness(retries, attempt)
        count = finer * substeps
        end = ti.min(s + left, count)
        if ti.static(program.has_soft_contact):
            if s == 0:
                common = _common_velocity(state, island)
        gently, candidates_now, way_now, fastest_now = _move_island(
            state, program, island, count, h / finer, s, end, candidates, way, fastest, common
        )
        is_gentle, left, s = is_gentle & gently, left - (end - s), end
        candidates, way, fastest = candidates_now, way_now, fastest_now
        if s == count:
            if attempt == last_one or (is_gentle & _island_is_sound(state, island)) == 1:
                is_open = 0
            else:
                _take_back(state, program, island)
                attempt, s, is_gentle, candidates = attempt + 1, 0, 1, OUTDATED
                way, fastest = ti.Vector.zero(ti.f32, 3), 0.0
                if attempt > retries:
                    _brake(state, island, 1)
    found = UNFINISHED
    if is_open == 0:
        numbers = ti.Vector([finer * substeps, h / finer, 0.0, 0.0])
        work_on(state, program, island, OWNER, FINISH, numbers, nothing.xyz)
        if attempt > retries:
            _brake(state, island, 0)
        found = 0
        for i in range(first, last):
            found += state.contact.has_failed[state.contact.island_body[i]]
    else:
        state.contact.island_pause[island] = ti.Vector([attempt, s, is_gentle, candidates])
        state.contact.island_way[island] = way
        state.contact.island_speed[island] = fastest
        state.contact.island_common[island] = common
    return found


@ti.func
def _step_island(state: ti.template(), program: ti.template(), island, substeps, h, most, goes_on):
    """One fixed step of one island, or the next `most` substeps of it.

    Returns: how many of its bodies failed, or UNFINISHED; and whether it is awake (1).
    """
    failed, is_awake = 0, 1
    if goes_on == 0:
        is_awake = wake_island(state, island)
        if is_awake == 1:
            nothing = ti.Vector.zero(ti.f32, 4)
            work_on(state, program, island, OWNER, BEGIN, nothing, nothing.xyz)
            state.contact.island_pause[island] = ti.Vector([0, 0, 1, NONE])
            state.contact.island_way[island] = ti.Vector.zero(ti.f32, 3)
            state.contact.island_speed[island] = 0.0
        else:
            state.contact.island_pause[island] = ti.Vector([DONE, 0, 0, 0])
    pause = state.contact.island_pause[island]
    if pause[0] == DONE:
        failed, is_awake = pause[1], pause[2]
    else:
        failed = _step_awake_island(state, program, island, substeps, h, most)
        if failed != UNFINISHED:
            is_awake = settle_island(state, island, substeps * h)
            state.contact.island_pause[island] = ti.Vector([DONE, failed, is_awake, 0])
    return failed, is_awake


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
    """One fixed step of every active body, or the next `most` substeps of it.

    One kernel, which calls one real function, because Taichi's cache would not find it again otherwise.

    Args:
        helpers: threads that may work on islands of others when there is none left for themselves.
    Returns: how many failed, or `ALL_SLEEP`; or UNFINISHED: then it is to be called again, with `goes_on` 1.
    """
    failed, awake, unfinished = 0, 0, 0
    ti.loop_config(serialize=True)
    for _ in range(1):
        if goes_on == 0:
            wake_by_colliders(state, body_count)
            if ti.static(program.has_soft_contact):
                find_islands(state, body_count, substeps * h)
        open_crowds(state, helpers)
    ti.loop_config(block_dim=1)
    for i in range(state.contact.island_count[None] + helpers):
        if i < state.contact.island_count[None]:
            failed_here, is_awake = _step_island(state, program, i, substeps, h, most, goes_on)
            failed += ti.max(failed_here, 0)
            awake += is_awake
            unfinished += int(failed_here == UNFINISHED)
            if is_crowd(state, i):
                ti.atomic_sub(state.contact.unfinished_crowds[None], 1)
        else:
            help_others(state, program, i - state.contact.island_count[None])
    found = ti.select(failed + awake == 0, ALL_SLEEP, failed)
    return ti.select(unfinished > 0, UNFINISHED, found)
