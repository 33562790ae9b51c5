"""Which vertices of an island are near which triangles: a spatial hash of the vertices, asked by the triangles.

The candidates hold until bodies have moved by the margin with which they were looked for.
"""

from taichi_soft.contact_fields import SLOTS
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
def _fill_table(state: ti.template(), island):
    """Counting sort of the island's outer vertices by the bucket of their cell."""
    table, cell = state.soft.island_table[island], state.soft.island_cell[island]
    for row in range(table[0], table[0] + table[1] + 1):
        state.soft.cell_first[row] = 0
    for pass_number in range(2):
        for i in range(state.contact.island_first[island], state.contact.island_first[island + 1]):
            outer = state.body_outer[state.contact.island_body[i]]
            for k in range(outer[0], outer[1]):
                x = state.particle_position[state.outer_particle[k]]
                row = table[0] + _bucket(_cell_of(x, cell), table[1])
                if pass_number == 0:
                    state.soft.cell_first[row] = state.soft.cell_first[row] + 1
                    state.soft.slot_count[k] = 0
                else:
                    at = state.soft.cell_first[row] - 1
                    state.soft.cell_first[row] = at
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
    lower, upper = ti.min(a, b, c) - margin, ti.max(a, b, c) + margin
    table, cell = state.soft.island_table[island], state.soft.island_cell[island]
    low, high = _cell_of(lower, cell), _cell_of(upper, cell)
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
    _fill_table(state, island)
    for i in range(state.contact.island_first[island], state.contact.island_first[island + 1]):
        body = state.contact.island_body[i]
        triangles = state.body_triangles[body]
        for t in range(triangles[0], triangles[1]):
            _search_triangle(state, island, body, t, margin)
