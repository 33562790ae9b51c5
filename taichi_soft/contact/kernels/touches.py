"""Record the pairs of bodies that touched in a step, and the sum of the impulses of each pair.

This happens only while contact events are recorded. Each island has its own part of the table of pairs, so
that threads share no rows. Pairs are found by hashing. Reading a row clears the row, so that the table is
empty before the next step.

Groups of fields: reads colliders, islands; writes soft.
"""

from taichi_soft.bodies.status import ACTIVE, ASLEEP
from taichi_soft.contact.fields import PAIR_ROWS
from taichi_soft.contact.kernels.features import first_slot_of
from taichi_soft.core.math.finite import is_finite
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti

OF_COLLIDER, OF_BODY = 0, 1
"""Kinds of the second member of a pair."""


@ti.func
def _find_pair(soft: ti.template(), first, count, a, b):
    """Return the row of bodies `a` and `b` among the `count` rows from `first` on, -1 if all rows are in use.

    A new pair gets a free row.
    """
    start = (a * 40503 + b) & 0x7FFFFFFF
    row, tried = -1, 0
    while row < 0 and tried < count:
        here = first + (start + tried) % count
        tried += 1
        pair = soft.pair_bodies[here]
        if pair.y == 0:  # the row is free: body 0 is never second
            soft.pair_bodies[here] = ti.Vector([a, b])
            row = here
        elif pair.x == a and pair.y == b:
            row = here
    return row


@ti.func
def add_touches(state: ti.template(), island):
    """Add the impulses between the bodies of an island in a substep to the rows of their pairs."""
    first, last = state.islands.first[island], state.islands.first[island + 1]
    for i in range(first, last):
        body = state.islands.body[i]
        first_slot = first_slot_of(state, body)
        for k in range(first_slot, first_slot + state.soft.contact_count[body]):
            slot = state.soft.contact_slot[k]
            normal_impulse = state.soft.slot_normal_impulse[slot]
            other = state.particle_body[state.soft.slot_points[slot].w]
            if normal_impulse > 0.0 and other != body:
                a, b = ti.min(body, other), ti.max(body, other)
                row = _find_pair(state.soft, first * PAIR_ROWS, (last - first) * PAIR_ROWS, a, b)
                if row < 0:
                    state.soft.pairs_lost[None] = 1  # all threads write the same value
                else:
                    on_vertex = (
                        normal_impulse * state.soft.slot_normal[slot] + state.soft.slot_friction_impulse[slot]
                    )
                    on_b = ti.select(body == b, 1.0, -1.0) * on_vertex
                    state.soft.pair_impulse[row] = state.soft.pair_impulse[row] + on_b


@ti.func
def clear_touches(state: ti.template(), island):
    """Clear the rows of an island, because its step is retried."""
    first, last = state.islands.first[island], state.islands.first[island + 1]
    row = first * PAIR_ROWS
    while row < last * PAIR_ROWS:
        state.soft.pair_bodies[row] = ti.Vector.zero(ti.i32, 2)
        state.soft.pair_impulse[row] = ti.Vector.zero(ti.f32, 3)
        row = row_behind(row)


@ti.func
def _write_touch(who: ti.template(), impulses: ti.template(), at, a, kind, b, impulse):
    who[at, 0], who[at, 1], who[at, 2] = a, kind, b
    for k in ti.static(range(3)):
        impulses[at, k] = impulse[k]


@ti.kernel
def read_touches(
    state: ti.template(),
    body_count: ti.i32,
    status: ti.types.ndarray(dtype=ti.i32, ndim=1),
    who: ti.types.ndarray(dtype=ti.i32, ndim=2),
    impulses: ti.types.ndarray(dtype=ti.f32, ndim=2),
):
    """Read the status of all bodies, and the pairs that touched in the last step, in a fixed order.

    Args:
        status: the array from the last call, or zeros, (bodies + 2,). Receives the current status of each
            body, then 1 if the table was too small for all pairs, then the number of pairs.
        who: receives for each pair the body, `OF_COLLIDER` or `OF_BODY`, and the collider or second body,
            (rows, 3).
        impulses: receives the impulse of the body on the collider or second body, (rows, 3) [N s].
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        count = 0
        status[body_count] = 0
        for body in range(body_count):
            before, now = status[body], state.body_status[body]
            status[body] = now
            if ti.static(state.capacity.contact.colliders > 0):
                if now == ACTIVE or (now == ASLEEP and before == ACTIVE):  # rows of other bodies are outdated
                    for c in range(state.colliders.count[None]):
                        impulse = state.colliders.impulse[body * state.colliders.capacity.colliders + c]
                        if ti.abs(impulse).max() > 0.0 and is_finite(impulse):
                            _write_touch(who, impulses, count, body, OF_COLLIDER, c, impulse)
                            count += 1
        if ti.static(state.capacity.contact.soft):
            for row in range(body_count * PAIR_ROWS):
                pair = state.soft.pair_bodies[row]
                if pair.y > 0:
                    impulse = state.soft.pair_impulse[row]
                    if is_finite(impulse):
                        _write_touch(who, impulses, count, pair.x, OF_BODY, pair.y, impulse)
                        count += 1
                    state.soft.pair_bodies[row] = ti.Vector.zero(ti.i32, 2)
                    state.soft.pair_impulse[row] = ti.Vector.zero(ti.f32, 3)
            status[body_count] = state.soft.pairs_lost[None]
            state.soft.pairs_lost[None] = 0
        status[body_count + 1] = count
