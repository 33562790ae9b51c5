"""A grid of the vertices of one body that may be near another one."""

from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti

CELL = 1.5
"""Edge of a cell of the grid over the mean edge of the triangles that look round in it. From 1 to 2 makes no
difference in a heap."""


MOST_EDGES = 64.0
"""Mean edges along one axis through which one triangle looks round. One that an exploding body has drawn out
over kilometres is left out, or the step that ends with that body frozen would take hours."""


@ti.func
def cell_of(x, lowest, cells, cell):
    """Cell of a grid which a point lies in, or the nearest, whatever the point."""
    return ti.min(ti.max(ti.cast((x - lowest) / cell, ti.i32), 0), cells - 1)


@ti.func
def _row_of(at, cells):
    return (at.z * cells.y + at.y) * cells.x + at.x


@ti.func
def boxes_overlap(lower, upper, other_lower, other_upper):
    """Whether two boxes, each by two corners, have a point in common."""
    return ti.max(other_lower - upper, lower - other_upper).max() <= 0.0


@ti.func
def find_box(state: ti.template(), body):
    """Boxes round the surface of a body, and round each of its triangles, as they are now."""
    outer = state.touching.body_outer[body]
    lower = state.particle_position[state.touching.outer_particle[outer[0]]]
    upper = lower
    for k in range(outer[0], outer[1]):
        x = state.particle_position[state.touching.outer_particle[k]]
        state.soft.found_count[k] = 0
        lower, upper = ti.min(lower, x), ti.max(upper, x)
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        state.soft.searched_position[p] = state.particle_position[p]
        state.soft.particle_gone[p] = 0.0
    if ti.static(state.capacity.contact.hull):
        for p in range(state.hull.body_points[body][0], state.hull.body_points[body][1]):
            state.soft.searched_position[p] = state.particle_position[p]
            state.soft.particle_gone[p] = 0.0
    state.contact.body_lower[body] = lower
    state.contact.body_upper[body] = upper
    triangles = state.touching.body_triangles[body]
    t = triangles[0]
    while t < triangles[1]:
        corners = state.touching.triangle_vertices[t]
        a = state.particle_position[corners[0]]
        b = state.particle_position[corners[1]]
        c = state.particle_position[corners[2]]
        state.soft.triangle_lower[t] = ti.min(a, b, c)
        state.soft.triangle_upper[t] = ti.max(a, b, c)
        t = row_behind(t)


@ti.func
def _choose_cells(size, count, smallest):
    """Cells along each axis of a grid, at most four for each of one or more points, and their edge [m].

    Args:
        size: of the grid, vec3 [m], not negative: it would have no end.
        count: of the points.
        smallest: edge that is wanted [m].
    """
    cell = smallest
    cells = size / cell + 1.0
    while cells.x * cells.y * cells.z > 4.0 * count:
        cell *= 1.25
        cells = size / cell + 1.0
    found = ti.cast(cells, ti.i32)
    # What explodes may be anywhere, and what is not finite nowhere.
    if found.min() < 1 or not cells.x * cells.y * cells.z <= 4.0 * count:
        found = ti.Vector.one(ti.i32, 3)
    return found, cell


@ti.func
def fill_grid(state: ti.template(), table, body, other, margin):
    """Put the vertices of a body that are within `margin` [m] of another's box into a grid.

    Returns: how many there are; the box round them; cells along each axis, and their edge [m].
    """
    lower, upper = state.contact.body_lower[other] - margin, state.contact.body_upper[other] + margin
    lowest, highest = upper, lower
    outer = state.touching.body_outer[body]
    count = 0
    for k in range(outer[0], outer[1]):
        x = state.particle_position[state.touching.outer_particle[k]]
        if ti.max(lower - x, x - upper).max() <= 0.0:
            state.soft.item[table[1] + count] = k
            count += 1
            lowest, highest = ti.min(lowest, x), ti.max(highest, x)
    cells, cell = ti.Vector.one(ti.i32, 3), ti.max(CELL * state.soft.body_surface[other].z, 1e-6)
    if count > 0:
        cells, cell = _choose_cells(highest - lowest, count, cell)
        last = table[0] + cells.x * cells.y * cells.z
        cell_row = table[0]
        while cell_row <= last:
            state.soft.cell_first[cell_row] = 0
            cell_row = row_behind(cell_row)
        for pass_number in range(2):
            i = table[1]
            while i < table[1] + count:
                k = state.soft.item[i]
                x = state.particle_position[state.touching.outer_particle[k]]
                row = table[0] + _row_of(cell_of(x, lowest, cells, cell), cells)
                # It counts up, and then down again to the first.
                at = state.soft.cell_first[row] + 1 - 2 * pass_number
                state.soft.cell_first[row] = at
                if pass_number == 1:
                    state.soft.cell_item[at] = k
                    state.soft.cell_position[at] = x
                i = row_behind(i)
            if pass_number == 0:
                total, cell_row = table[1], table[0]
                while cell_row <= last:
                    total += state.soft.cell_first[cell_row]
                    state.soft.cell_first[cell_row] = total
                    cell_row = row_behind(cell_row)
    return count, lowest, highest, cells, cell
