"""Sort the vertices or the contact edges of one body that can be near another body into a grid.

Groups of fields: reads hull; writes soft.
"""

from taichi_soft.bodies.contact_edges import OF_ROPE, SLIM
from taichi_soft.contact.kernels.features import end_feature, feature_position, first_feature
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti

CELL = 1.5
"""Edge of a grid cell, relative to the mean edge of the triangles that query the grid. Values from 1 to 2 are
equally fast in a heap."""


MAX_QUERY_EDGES = 64.0
"""Largest extent of a triangle's query along an axis, in mean edges. Larger triangles belong to exploding
bodies that extend over kilometres, and are skipped. Otherwise, the step that freezes the body would take
hours."""


@ti.func
def cell_of(x, lowest, cells, cell):
    """Return the cell that contains the point `x`, or the nearest cell if `x` is outside the grid."""
    return ti.min(ti.max(ti.cast((x - lowest) / cell, ti.i32), 0), cells - 1)


@ti.func
def _row_of(at, cells):
    return (at.z * cells.y + at.y) * cells.x + at.x


@ti.func
def boxes_overlap(lower, upper, other_lower, other_upper):
    """True if two boxes, each given by two corners, touch or overlap."""
    return ti.max(other_lower - upper, lower - other_upper).max() <= 0.0


@ti.func
def edge_size(state: ti.template(), e):
    """Return the squares of the length of a contact edge, and of the smaller height of its triangles [m^2].

    The height is infinite at sheets, and 0 at ropes.
    """
    corners = state.soft.edge_corners[e]
    a = state.particle_position[corners.x]
    d = state.particle_position[corners.y] - a
    length2, height2 = d.dot(d), ti.cast(ti.select(corners.z == OF_ROPE, 0.0, 1e30), ti.f32)
    if corners.z >= 0:
        for k in ti.static(range(2, 4)):
            across = d.cross(state.particle_position[corners[k]] - a)
            height2 = ti.min(height2, across.dot(across) / ti.max(length2, 1e-30))
    return length2, height2


@ti.func
def update_boxes(state: ti.template(), body):
    """Update the boxes around a body and around each of its triangles, and store the current positions."""
    outer = state.touching.body_outer[body]
    lower = state.particle_position[state.touching.outer_particle[outer[0]]]
    upper = lower
    for k in range(outer[0], outer[1]):
        x = state.particle_position[state.touching.outer_particle[k]]
        lower, upper = ti.min(lower, x), ti.max(upper, x)
    feature = first_feature(state, body)
    while feature < end_feature(state, body):
        state.soft.found_count[feature] = 0
        feature = row_behind(feature)
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        state.soft.searched_position[p] = state.particle_position[p]
        state.soft.particle_gone[p] = 0.0
    if ti.static(state.capacity.contact.hull):
        for p in range(state.hull.body_points[body][0], state.hull.body_points[body][1]):
            state.soft.searched_position[p] = state.particle_position[p]
            state.soft.particle_gone[p] = 0.0
    state.body_bounds_lower[body] = lower
    state.body_bounds_upper[body] = upper
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
    longest2, is_slim, e = ti.cast(0.0, ti.f32), 0, state.soft.body_edges[body][0]
    while e < state.soft.body_edges[body][1]:
        length2, height2 = edge_size(state, e)
        longest2 = ti.max(longest2, length2)
        is_slim = is_slim | int(e < state.soft.body_sharp_end[body] and SLIM * SLIM * height2 <= length2)
        e = row_behind(e)
    state.soft.body_half_edge[body] = 0.5 * ti.sqrt(longest2)
    state.soft.body_is_slim[body] = is_slim


@ti.func
def _choose_cells(size, count, smallest):
    """Return the number of cells along each axis of a grid, and their edge [m]; at most four cells per point.

    Args:
        size: size of the grid, vec3 [m]. It must not be negative, or the loop would not end.
        count: number of points, 1 or more.
        smallest: smallest edge of a cell [m].
    """
    cell = smallest
    cells = size / cell + 1.0
    while cells.x * cells.y * cells.z > 4.0 * count:
        cell *= 1.25
        cells = size / cell + 1.0
    found = ti.cast(cells, ti.i32)
    # Vertices of an exploding body can be very far away, or not finite.
    if found.min() < 1 or not cells.x * cells.y * cells.z <= 4.0 * count:
        found = ti.Vector.one(ti.i32, 3)
    return found, cell


@ti.func
def fill_grid(state: ti.template(), table, body, other, first, end, margin):
    """Sort the features of `body` within `margin` [m] of the box of `other` into a grid.

    Args:
        table: first rows of `body` in `cell_first` and in `item`.
        first, end: range of features, only vertices or only edges. An edge counts as its middle.
    Returns: number of these features; box around them; number of cells along each axis; edge of a cell [m].
    """
    lower, upper = state.body_bounds_lower[other] - margin, state.body_bounds_upper[other] + margin
    lowest, highest = upper, lower
    count = 0
    for k in range(first, end):
        x = feature_position(state, body, k)
        if ti.max(lower - x, x - upper).max() <= 0.0:
            state.soft.item[table[1] + count] = k
            count += 1
            lowest, highest = ti.min(lowest, x), ti.max(highest, x)
    cells, cell = ti.Vector.one(ti.i32, 3), ti.max(CELL * state.body_surface[other].z, 1e-6)
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
                x = feature_position(state, body, k)
                row = table[0] + _row_of(cell_of(x, lowest, cells, cell), cells)
                # The first pass counts the features of a cell. The second pass counts down to its first row.
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
