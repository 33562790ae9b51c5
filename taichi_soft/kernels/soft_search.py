"""Which vertices of an island are near which triangles: a spatial hash of the vertices, asked by the triangles.

The candidates hold until bodies have moved by the margin with which they were looked for.
"""

from taichi_soft.contact_fields import NEIGHBOURS, SLOTS
from taichi_soft.kernels.islands import may_touch
from taichi_soft.math.triangle import closest_point_on_triangle
from taichi_soft.runtime import ti

SELF_DISTANCE = 1.5
"""Mean edges: what is nearer at rest belongs together, and is no contact of a body with itself."""


@ti.func
def _cell_of(x, cell):
    return ti.cast(ti.floor(x / cell), ti.i32)


@ti.func
def _bucket(cell, size):
    """Row of a cell in a table of `size` rows, a power of two (Teschner et al. 2003)."""
    return ((cell.x * 73856093) ^ (cell.y * 19349663) ^ (cell.z * 83492791)) & (size - 1)


@ti.func
def _boxes_overlap(soft: ti.template(), a, b):
    below = (soft.body_lower[b] - soft.body_upper[a]).max() <= 0.0
    return below and (soft.body_lower[a] - soft.body_upper[b]).max() <= 0.0


@ti.func
def _find_neighbours(state: ti.template(), island, margin):
    """For each body of an island those whose boxes, half the `margin` [m] wider, overlap its own."""
    first, last = state.contact.island_first[island], state.contact.island_first[island + 1]
    for i in range(first, last):
        body = state.contact.island_body[i]
        outer = state.body_outer[body]
        lower = state.particle_position[state.outer_particle[outer[0]]]
        upper = lower
        for k in range(outer[0], outer[1]):
            x = state.particle_position[state.outer_particle[k]]
            lower, upper = ti.min(lower, x), ti.max(upper, x)
        state.soft.body_lower[body] = lower - 0.5 * margin
        state.soft.body_upper[body] = upper + 0.5 * margin
    for i in range(first, last):
        body = state.contact.island_body[i]
        count = 0
        for j in range(first, last):
            other = state.contact.island_body[j]
            if j != i and count <= NEIGHBOURS:
                if _boxes_overlap(state.soft, body, other) and may_touch(state, body, other):
                    if count < NEIGHBOURS:
                        state.soft.neighbour[body * NEIGHBOURS + count] = other
                    count += 1
        if state.soft.body_touches_itself[body] == 1:
            count = NEIGHBOURS + 1
        state.soft.neighbour_count[body] = count


@ti.func
def _is_near_others(soft: ti.template(), body, lower, upper):
    """Whether a box reaches into that of a neighbour of its body."""
    count = soft.neighbour_count[body]
    near = count > NEIGHBOURS
    if not near:
        for i in range(count):
            other = soft.neighbour[body * NEIGHBOURS + i]
            below = (soft.body_lower[other] - upper).max() <= 0.0
            near = near or (below and (lower - soft.body_upper[other]).max() <= 0.0)
    return near


@ti.func
def _fill_table(state: ti.template(), island, margin):
    """Counting sort, by the bucket of their cell, of the vertices that may be near another body."""
    table, cell = state.soft.island_table[island], state.soft.island_cell[island]
    for row in range(table[0], table[0] + table[1] + 1):
        state.soft.cell_first[row] = 0
    for pass_number in range(2):
        for i in range(state.contact.island_first[island], state.contact.island_first[island + 1]):
            body = state.contact.island_body[i]
            outer = state.body_outer[body]
            for k in range(outer[0], outer[1]):
                x = state.particle_position[state.outer_particle[k]]
                if pass_number == 0:
                    state.soft.slot_count[k] = 0
                if _is_near_others(state.soft, body, x - 0.5 * margin, x + 0.5 * margin):
                    row = table[0] + _bucket(_cell_of(x, cell), table[1])
                    at = state.soft.cell_first[row] - 2 * pass_number + 1
                    state.soft.cell_first[row] = at
                    if pass_number == 1:
                        state.soft.cell_item[at] = k
        if pass_number == 0:
            total = table[2]
            for row in range(table[0], table[0] + table[1] + 1):
                total += state.soft.cell_first[row]
                state.soft.cell_first[row] = total


@ti.func
def _keep(soft: ti.template(), k, triangle, distance):
    """Put a triangle among the nearest of a vertex."""
    count = soft.slot_count[k]
    at = count
    if count == SLOTS:
        for i in range(SLOTS):
            if at == SLOTS or soft.slot_distance[k * SLOTS + i] > soft.slot_distance[k * SLOTS + at]:
                at = i
        if soft.slot_distance[k * SLOTS + at] <= distance:
            at = SLOTS
    else:
        soft.slot_count[k] = count + 1
    if at < SLOTS:
        soft.slot_triangle[k * SLOTS + at] = triangle
        soft.slot_press[k * SLOTS + at] = 0.0
        soft.slot_rub[k * SLOTS + at] = ti.Vector.zero(ti.f32, 3)
        soft.slot_distance[k * SLOTS + at] = distance


@ti.func
def _is_self_neighbour(state: ti.template(), p, corners, edge):
    """Whether a vertex and a triangle of one body are near each other at rest."""
    a, b, c = (
        state.soft.rest_position[corners[0]],
        state.soft.rest_position[corners[1]],
        state.soft.rest_position[corners[2]],
    )
    x = state.soft.rest_position[p]
    weights = closest_point_on_triangle(x, a, b, c)
    gap = x - weights.x * a - weights.y * b - weights.z * c
    return gap.norm() < SELF_DISTANCE * edge


@ti.func
def _search_triangle(state: ti.template(), island, body, triangle, margin):
    """Give a triangle to the vertices within `margin` [m] of it."""
    corners = state.triangle_vertices[triangle]
    a = state.particle_position[corners[0]]
    b = state.particle_position[corners[1]]
    c = state.particle_position[corners[2]]
    half = 0.5 * margin
    is_near = _is_near_others(state.soft, body, ti.min(a, b, c) - half, ti.max(a, b, c) + half)
    lower, upper = ti.min(a, b, c) - margin, ti.max(a, b, c) + margin
    table, cell = state.soft.island_table[island], state.soft.island_cell[island]
    low, high = _cell_of(lower, cell), _cell_of(upper, cell)
    if not is_near:
        high = low - 1
    for cx, cy, cz in ti.ndrange((low.x, high.x + 1), (low.y, high.y + 1), (low.z, high.z + 1)):
        here = ti.Vector([cx, cy, cz])
        row = table[0] + _bucket(here, table[1])
        for item in range(state.soft.cell_first[row], state.soft.cell_first[row + 1]):
            k = state.soft.cell_item[item]
            p = state.outer_particle[k]
            x = state.particle_position[p]
            other = state.particle_body[p]
            within = (x - lower).min() >= 0.0 and (upper - x).min() >= 0.0
            # Two cells may share a bucket: each vertex counts in its own cell only.
            if within and (_cell_of(x, cell) == here).all():
                wanted = other != body and may_touch(state, body, other)
                if other == body and state.soft.body_touches_itself[body] == 1:
                    wanted = not _is_self_neighbour(state, p, corners, state.soft.body_surface[body].z)
                if wanted:
                    weights = closest_point_on_triangle(x, a, b, c)
                    gap = (x - weights.x * a - weights.y * b - weights.z * c).norm()
                    if gap < margin:
                        _keep(state.soft, k, triangle, gap)


@ti.func
def search_island(state: ti.template(), island, margin):
    """Find the candidates of all vertices of an island, within `margin` [m] beyond the thickness."""
    _find_neighbours(state, island, margin)
    _fill_table(state, island, margin)
    for i in range(state.contact.island_first[island], state.contact.island_first[island + 1]):
        body = state.contact.island_body[i]
        triangles = state.body_triangles[body]
        for t in range(triangles[0], triangles[1]):
            _search_triangle(state, island, body, t, margin)
