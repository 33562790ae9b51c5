"""Find islands: groups of bodies that can touch in a step or are joined, directly or through other bodies.

One thread owns an island, so that impulses between its bodies have a fixed order (see `jobs.py`). A body that
cannot touch other bodies is a separate island.

Groups of fields: reads hull, joints; writes islands.
"""

from taichi_soft.bodies.kernels.origins import enter_local, leave_local, origin_near, rounding_at
from taichi_soft.bodies.kernels.particles import gravity_on
from taichi_soft.bodies.status import ABSENT, ASLEEP, FROZEN_DISABLED
from taichi_soft.contact.kernels.filters import may_touch
from taichi_soft.contact.kernels.hull_points import motion_of
from taichi_soft.control.kernels.joints import MOST_JOINTS, mark_held
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti

ISLAND_MARGIN = 0.25
"""Margin around the box of a body, in mean edge lengths. It covers motion that the velocities at the start of
the step do not predict."""


@ti.func
def _find_boxes(state: ti.template(), body_count, dt):
    """Compute the box that each body's surface sweeps in a step of `dt` [s]. Bodies that take part in nothing
    get a box far away.
    """
    for body in range(body_count):
        if state.body_status[body] >= ABSENT:
            state.body_bounds_lower[body] = ti.Vector.one(ti.f32, 3) * 1e30
            continue
        if state.body_status[body] == ASLEEP:
            continue  # the box of a sleeping body stays valid
        outer = state.touching.body_outer[body]
        p = state.touching.outer_particle[outer[0]]
        lower, upper = state.particle_position[p], state.particle_position[p]
        slow, fast = state.particle_velocity[p], state.particle_velocity[p]
        if ti.static(state.capacity.contact.hull):
            lower, slow = motion_of(state, p)
            upper, fast = lower, slow
        k = outer[0]
        while k < outer[1]:
            p = state.touching.outer_particle[k]
            x, v = state.particle_position[p], state.particle_velocity[p]
            if ti.static(state.capacity.contact.hull):
                x, v = motion_of(state, p)
            lower, upper = ti.min(lower, x, x + dt * v), ti.max(upper, x, x + dt * v)
            slow, fast = ti.min(slow, v), ti.max(fast, v)
            k = row_behind(k)
        surface = state.body_surface[body]
        # Extend the box: parts of a body can change their direction of motion during the step.
        fall = gravity_on(state, body).norm() * dt * dt
        reach = 0.5 * (fast - slow) * dt + fall + surface.y + ISLAND_MARGIN * surface.z
        reach += rounding_at(state.body_origin[body])
        state.body_bounds_lower[body] = lower - reach
        state.body_bounds_upper[body] = upper + reach


@ti.func
def _sort_by_lower_x(state: ti.template(), body_count):
    """Sort bodies by the lower x of their boxes.

    The order hardly changes between steps, so an insertion sort is fast.
    """
    for i in range(1, body_count):
        body = state.islands.sweep_order[i]
        x = state.body_bounds_lower[body].x
        j = i - 1
        while j >= 0 and state.body_bounds_lower[state.islands.sweep_order[ti.max(j, 0)]].x > x:
            state.islands.sweep_order[j + 1] = state.islands.sweep_order[j]
            j -= 1
        state.islands.sweep_order[j + 1] = body


@ti.func
def _root(islands: ti.template(), body):
    root = body
    while islands.parent[root] != root:
        root = islands.parent[root]
    return root


@ti.func
def _join(islands: ti.template(), a, b):
    p, q = _root(islands, a), _root(islands, b)
    islands.parent[ti.max(p, q)] = ti.min(p, q)


@ti.func
def _join_overlapping(state: ti.template(), body_count):
    for i in range(body_count):
        a = state.islands.sweep_order[i]
        j = i + 1
        is_open = int(state.body_status[a] < ABSENT)
        while is_open == 1 and j < body_count:
            b = state.islands.sweep_order[j]
            j += 1
            if state.body_bounds_lower[b].x > state.body_bounds_upper[a].x:
                is_open = 0
            elif state.body_status[b] < ABSENT and may_touch(state, a, b):
                apart = 0
                for k in ti.static(range(1, 3)):
                    apart = apart | int(state.body_bounds_lower[a][k] > state.body_bounds_upper[b][k])
                    apart = apart | int(state.body_bounds_lower[b][k] > state.body_bounds_upper[a][k])
                if apart == 0:
                    _join(state.islands, a, b)


@ti.func
def _join_held(state: ti.template()):
    for j in range(MOST_JOINTS):
        ends = state.joints.bodies[j]
        # A joint to a body that was switched off does not act.
        is_on = int(ends[0] > 0)
        for i in ti.static(range(2)):
            is_on = is_on & int(state.body_status[ti.max(ends[i] - 1, 0)] <= ABSENT)
        if is_on == 1:
            _join(state.islands, ends[0] - 1, ends[1] - 1)


@ti.func
def _is_listed(state: ti.template(), body, end):
    """Return 1 if a body and its root have a status below `end`. `parent` must contain the root."""
    root = state.islands.parent[body]
    return int(state.body_status[body] < end) & int(state.body_status[root] < end)


@ti.func
def _list_islands(state: ti.template(), body_count, end):
    """Write the bodies with a status below `end` to `body`, sorted by island and then by number.

    The algorithm is a counting sort.
    """
    fields, islands = state.islands, 0
    for body in range(body_count):
        # A parent's number is never larger than its child's, so the parent of the parent is already the root.
        root = fields.parent[fields.parent[body]]
        fields.parent[body] = root
        if _is_listed(state, body, end):
            if root == body:
                fields.of_body[body] = islands
                fields.first[islands] = 0  # number of bodies counted so far
                islands += 1
            island = fields.of_body[root]
            fields.of_body[body] = island
            fields.first[island] = fields.first[island] + 1
    rows, island = 0, 0
    while island < islands:
        rows += fields.first[island]
        fields.first[island] = rows  # the row after the island's last row
        island = row_behind(island)
    for i in range(body_count):
        body = body_count - 1 - i
        if _is_listed(state, body, end):
            island = fields.of_body[body]
            row = fields.first[island] - 1
            fields.first[island] = row
            fields.body[row] = body
    fields.first[islands] = rows
    fields.count[None] = islands


@ti.real_func
def find_islands(state: ti.template(), body_count: ti.i32, dt: ti.f32):
    """Find and list the islands of a step of `dt` [s]."""
    body = 0
    while body < body_count:
        state.islands.parent[body] = body
        body = row_behind(body)
    _find_boxes(state, body_count, dt)
    _sort_by_lower_x(state, body_count)
    _join_overlapping(state, body_count)
    _join_held(state)
    mark_held(state, 1)
    _list_islands(state, body_count, ABSENT)


@ti.real_func
def enter_island(state: ti.template(), island: ti.i32):
    """Give all bodies of an island the same origin, and transform their positions to it."""
    row, end = state.islands.first[island], state.islands.first[island + 1]
    body = state.islands.body[row]
    x = state.particle_position[state.body_particles[body][0]]
    origin = origin_near(x, state.body_origin[body])
    while row < end:
        enter_local(state, state.islands.body[row], origin)
        row = row_behind(row)


@ti.real_func
def leave_island(state: ti.template(), island: ti.i32):
    """Transform the positions of all bodies of an island to the world, after `enter_island`."""
    row, end = state.islands.first[island], state.islands.first[island + 1]
    while row < end:
        leave_local(state, state.islands.body[row])
        row = row_behind(row)


@ti.kernel
def read_islands(state: ti.template(), islands: ti.types.ndarray(dtype=ti.i32, ndim=1)):
    """Write the number of each body's island in the last step to `islands`."""
    ti.loop_config(serialize=True)
    for body in range(islands.shape[0]):
        islands[body] = state.islands.of_body[body]


@ti.kernel
def list_joined_islands(state: ti.template(), body_count: ti.i32):
    """List the islands of joined bodies in a world whose bodies cannot touch each other.

    Call this after joints change.
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        for body in range(body_count):
            state.islands.parent[body] = body
        _join_held(state)
        # Include empty slots, which can be filled at any time, and bodies that were switched off.
        _list_islands(state, body_count, FROZEN_DISABLED + 1)
