"""Which vertices of an island are near which triangles of other bodies, or of their own.

For two bodies whose boxes overlap, the vertices of one that may be near the other go into a grid, and the
triangles of the other look round in it. Each body has a margin, and what is found holds until one of its
vertices is farther than that from where it was.
"""

from taichi_soft.contact.fields import FOUND, NO_CONTACT, SLOTS
from taichi_soft.contact.kernels.filters import may_touch
from taichi_soft.control.kernels.joints import are_joined
from taichi_soft.core.constants import LANES, ROW_BITS
from taichi_soft.core.math.triangle import closest_point_on_triangle
from taichi_soft.core.runtime import ti

FORESIGHT = 1.25
"""A search is to hold for so many times the way of a body's fastest vertex until the end of the step."""

SHORTEST, LONGEST = 0.1, 0.3
"""Mean edges: the least and the greatest such way."""

SELF_DISTANCE = 1.5
"""Mean edges: what is nearer at rest belongs together, and is no contact of a body with itself."""

CELL = 1.5
"""Edge of a cell of the grid over the mean edge of the triangles that look round in it. From 1 to 2 makes no
difference in a heap."""

MOST_EDGES = 64.0
"""Mean edges along one axis through which one triangle looks round. One that an exploding body has drawn out
over kilometres is left out, or the step that ends with that body frozen would take hours."""


@ti.func
def _cell_of(x, lowest, cells, cell):
    """Cell of a grid which a point lies in, or the nearest, whatever the point."""
    return ti.min(ti.max(ti.cast((x - lowest) / cell, ti.i32), 0), cells - 1)


@ti.func
def _row_of(at, cells):
    return (at.z * cells.y + at.y) * cells.x + at.x


@ti.func
def _boxes_overlap(lower, upper, other_lower, other_upper):
    return ti.max(other_lower - upper, lower - other_upper).max() <= 0.0


@ti.func
def _find_box(state: ti.template(), body):
    """Boxes round the surface of a body, and round each of its triangles, as they are now."""
    outer = state.body_outer[body]
    lower = state.particle_position[state.outer_particle[outer[0]]]
    upper = lower
    for k in range(outer[0], outer[1]):
        x = state.particle_position[state.outer_particle[k]]
        state.soft.found_count[k] = 0
        lower, upper = ti.min(lower, x), ti.max(upper, x)
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        state.soft.searched_position[p] = state.particle_position[p]
        state.soft.particle_gone[p] = 0.0
    state.contact.body_lower[body] = lower
    state.contact.body_upper[body] = upper
    triangles = state.body_triangles[body]
    for t in range(triangles[0], triangles[1]):
        corners = state.triangle_vertices[t]
        a = state.particle_position[corners[0]]
        b = state.particle_position[corners[1]]
        c = state.particle_position[corners[2]]
        state.soft.triangle_lower[t] = ti.min(a, b, c)
        state.soft.triangle_upper[t] = ti.max(a, b, c)


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
def _fill_grid(state: ti.template(), table, body, other, margin):
    """Put the vertices of a body that are within `margin` [m] of another's box into a grid.

    Returns: how many there are; the box round them; cells along each axis, and their edge [m].
    """
    lower, upper = state.contact.body_lower[other] - margin, state.contact.body_upper[other] + margin
    lowest, highest = upper, lower
    outer = state.body_outer[body]
    count = 0
    for k in range(outer[0], outer[1]):
        x = state.particle_position[state.outer_particle[k]]
        if ti.max(lower - x, x - upper).max() <= 0.0:
            state.soft.item[table[1] + count] = k
            count += 1
            lowest, highest = ti.min(lowest, x), ti.max(highest, x)
    cells, cell = ti.Vector.one(ti.i32, 3), ti.max(CELL * state.soft.body_surface[other].z, 1e-6)
    if count > 0:
        cells, cell = _choose_cells(highest - lowest, count, cell)
        last = table[0] + cells.x * cells.y * cells.z
        for row in range(table[0], last + 1):
            state.soft.cell_first[row] = 0
        for pass_number in range(2):
            for i in range(table[1], table[1] + count):
                k = state.soft.item[i]
                x = state.particle_position[state.outer_particle[k]]
                row = table[0] + _row_of(_cell_of(x, lowest, cells, cell), cells)
                # It counts up, and then down again to the first.
                at = state.soft.cell_first[row] + 1 - 2 * pass_number
                state.soft.cell_first[row] = at
                if pass_number == 1:
                    state.soft.cell_item[at] = k
                    state.soft.cell_position[at] = x
            if pass_number == 0:
                total = table[1]
                for row in range(table[0], last + 1):
                    total += state.soft.cell_first[row]
                    state.soft.cell_first[row] = total
    return count, lowest, highest, cells, cell


@ti.func
def forget_candidates(state: ti.template(), body):
    """Drop the candidates of a body's vertices, but for what its search needs to go on with their contacts.

    A search that began without the impulses of the last substep would let all sag a little, once a step, and
    a heap would never cease to tremble.
    """
    outer = state.body_outer[body]
    for k in range(outer[0], outer[1]):
        p = state.outer_particle[k]
        state.soft.kept_normal_impulse[p] = 0.0
    first_slot = outer[0] * SLOTS
    for k in range(first_slot, first_slot + state.soft.contact_count[body]):
        slot = state.soft.contact_slot[k]
        p = state.soft.slot_vertices[slot].x
        if state.soft.slot_normal_impulse[slot] > state.soft.kept_normal_impulse[p]:
            state.soft.kept_triangle[p] = state.soft.slot_triangle[slot]
            state.soft.kept_normal_impulse[p] = state.soft.slot_normal_impulse[slot]
            state.soft.kept_friction_impulse[p] = state.soft.slot_friction_impulse[slot]
    state.soft.slot_count[body] = 0
    state.soft.contact_count[body] = 0


@ti.func
def _farthest_found(soft: ti.template(), k):
    """Row of what is farthest of all that was found for a vertex."""
    farthest = k * FOUND
    for row in range(k * FOUND + 1, k * FOUND + soft.found_count[k]):
        if soft.found_distance[row] > soft.found_distance[farthest]:
            farthest = row
    return farthest


@ti.func
def _keep(soft: ti.template(), k, triangle, distance):
    """Put a triangle among the nearest of a vertex.

    Returns: the distance of the one that found no place [m].
    """
    row, lost = k * FOUND + soft.found_count[k], ti.cast(NO_CONTACT, ti.f32)
    if soft.found_count[k] == FOUND:
        row = _farthest_found(soft, k)
        lost = ti.max(soft.found_distance[row], distance)
    else:
        soft.found_count[k] = soft.found_count[k] + 1
    if distance < lost:
        soft.found_triangle[row] = triangle
        soft.found_distance[row] = distance
    return lost


@ti.func
def _note_lost(state: ti.template(), body, distance, thickness):
    """Note that something `distance` [m] from a vertex of a body found no room.

    What touches at `thickness` [m] need not be looked for again before that is used up.
    """
    way = ti.max(distance - thickness, 2.0 * SHORTEST * state.soft.body_surface[body].z)
    state.soft.body_lost[body] = ti.min(state.soft.body_lost[body], way)


@ti.func
def _list_candidates(state: ti.template(), body, thickness):
    """Make candidates of what was found for the vertices of a body, which go on with their contacts.

    Where that is more than there is room for, those that found most give up what is farthest.
    Args:
        thickness: the greatest at which it touches another body [m].
    """
    outer = state.body_outer[body]
    total = 0
    for k in range(outer[0], outer[1]):
        total += state.soft.found_count[k]
    is_too_much = total > (outer[1] - outer[0]) * SLOTS
    slot, contacts = outer[0] * SLOTS, 0
    for k in range(outer[0], outer[1]):
        while is_too_much and state.soft.found_count[k] > SLOTS:
            row, last = _farthest_found(state.soft, k), k * FOUND + state.soft.found_count[k] - 1
            _note_lost(state, body, state.soft.found_distance[row], thickness)
            state.soft.found_triangle[row] = state.soft.found_triangle[last]
            state.soft.found_distance[row] = state.soft.found_distance[last]
            state.soft.found_count[k] = state.soft.found_count[k] - 1
        p = state.outer_particle[k]
        for row in range(k * FOUND, k * FOUND + state.soft.found_count[k]):
            triangle = state.soft.found_triangle[row]
            corners = state.triangle_vertices[triangle]
            other = state.particle_body[corners[0]]
            mutual = 0.5 * (state.soft.body_surface[body].y + state.soft.body_surface[other].y)
            state.soft.slot_vertices[slot] = ti.Vector([p, corners[0], corners[1], corners[2]])
            state.soft.slot_triangle[slot] = triangle
            state.soft.slot_spare[slot] = state.soft.found_distance[row] - mutual
            state.soft.slot_normal_impulse[slot] = 0.0
            state.soft.slot_friction_impulse[slot] = ti.Vector.zero(ti.f32, 3)
            if state.soft.kept_triangle[p] == triangle and state.soft.kept_normal_impulse[p] > 0.0:
                state.soft.slot_normal_impulse[slot] = state.soft.kept_normal_impulse[p]
                state.soft.slot_friction_impulse[slot] = state.soft.kept_friction_impulse[p]
                state.soft.contact_slot[outer[0] * SLOTS + contacts] = slot
                contacts += 1
            slot += 1
    state.soft.slot_count[body] = slot - outer[0] * SLOTS
    state.soft.contact_count[body] = contacts


@ti.func
def _is_self_neighbour(state: ti.template(), p, corners, edge):
    """Whether a vertex and a triangle of one body are near each other at rest."""
    a = state.rest_position[corners[0]]
    b = state.rest_position[corners[1]]
    c = state.rest_position[corners[2]]
    x = state.rest_position[p]
    weights = closest_point_on_triangle(x, a, b, c)
    return (x - weights.x * a - weights.y * b - weights.z * c).norm() < SELF_DISTANCE * edge


@ti.func
def _search_triangle(
    state: ti.template(),
    table,
    lowest,
    highest,
    cells,
    cell,
    body,
    other,
    is_joined,
    triangle,
    margin,
    thickness,
):
    """Give a triangle of `other` to the vertices of `body` within `margin` [m] of it.

    Those in the grid lie between `lowest` and `highest`. Where the two are joined, what the joint holds is
    left out: it is to stay where it is.
    """
    lower = ti.max(state.soft.triangle_lower[triangle] - margin, lowest)
    upper = ti.min(state.soft.triangle_upper[triangle] + margin, highest)
    if (upper - lower).max() <= MOST_EDGES * ti.max(state.soft.body_surface[other].z, 1e-6):
        corners = state.triangle_vertices[triangle]
        a = state.particle_position[corners[0]]
        b = state.particle_position[corners[1]]
        c = state.particle_position[corners[2]]
        is_held = 0
        for i in ti.static(range(3)):
            is_held = is_held | state.joints.is_held[corners[i]]
        low, high = _cell_of(lower, lowest, cells, cell), _cell_of(upper, lowest, cells, cell)
        for cz in range(low.z, high.z + 1):
            for cy in range(low.y, high.y + 1):
                row = table[0] + (cz * cells.y + cy) * cells.x  # cells along x lie side by side
                first, last = state.soft.cell_first[row + low.x], state.soft.cell_first[row + high.x + 1]
                for item in range(first, last):
                    x = state.soft.cell_position[item]
                    wanted = ti.max(lower - x, x - upper).max() <= 0.0
                    k = state.soft.cell_item[item]
                    p = state.outer_particle[k]
                    if wanted and is_joined == 1:
                        wanted = is_held | state.joints.is_held[p] == 0
                    if wanted and other == body:
                        edge = state.soft.body_surface[other].z
                        wanted = not _is_self_neighbour(state, p, corners, edge)
                    if wanted:
                        weights = closest_point_on_triangle(x, a, b, c)
                        gap = (x - weights.x * a - weights.y * b - weights.z * c).norm()
                        if gap < margin:
                            lost = _keep(state.soft, k, triangle, gap)
                            if lost < NO_CONTACT:
                                _note_lost(state, body, lost, thickness)


@ti.func
def _search_pair(state: ti.template(), body, other, margin, thickness):
    """Vertices of `body` near triangles of `other`, within `margin` [m]; they touch at `thickness` [m]."""
    outer = state.body_outer[body]
    table = ti.Vector([4 * outer[0] + body, outer[0]])  # first row of the cells and of the items
    count, lowest, highest, cells, cell = _fill_grid(state, table, body, other, margin)
    if count > 0:
        is_joined = are_joined(state, body, other)
        triangles = state.body_triangles[other]
        near_lowest, near_highest = lowest - margin, highest + margin
        for block in range((triangles[1] - triangles[0] + LANES - 1) // LANES):
            first = (triangles[0] + block * LANES) & ROW_BITS
            is_near = ti.Vector.zero(ti.i32, LANES)
            for lane in range(LANES):
                lower = state.soft.triangle_lower[first + lane] - near_highest
                upper = near_lowest - state.soft.triangle_upper[first + lane]
                is_near[lane] = ti.cast(ti.max(lower, upper).max() <= 0.0, ti.i32)
            for lane in range(ti.min(LANES, triangles[1] - first)):
                if is_near[lane] == 1:
                    _search_triangle(
                        state,
                        table,
                        lowest,
                        highest,
                        cells,
                        cell,
                        body,
                        other,
                        is_joined,
                        first + lane,
                        margin,
                        thickness,
                    )


@ti.real_func
def search_body(state: ti.template(), body: ti.i32, island: ti.i32):
    """Find the candidates of a body's vertices, after `begin_search` of all its island."""
    lower, upper = state.contact.body_lower[body], state.contact.body_upper[body]
    thickest = ti.cast(0.0, ti.f32)
    for j in range(state.contact.island_first[island], state.contact.island_first[island + 1]):
        other = state.contact.island_body[j]
        thickness = 0.5 * (state.soft.body_surface[body].y + state.soft.body_surface[other].y)
        thickest = ti.max(thickest, thickness)
        margin = thickness + state.soft.body_reach[body] + state.soft.body_reach[other]
        wanted = state.soft.body_touches_itself[body] == 1
        if other != body:
            their_lower, their_upper = state.contact.body_lower[other], state.contact.body_upper[other]
            wanted = may_touch(state, body, other) and _boxes_overlap(
                lower - margin, upper + margin, their_lower, their_upper
            )
        if wanted:
            _search_pair(state, body, other, margin, thickness)
    _list_candidates(state, body, thickest)


@ti.func
def has_contact_pairs(state: ti.template(), island):
    """Whether anything in an island may touch a body (1)."""
    first, last = state.contact.island_first[island], state.contact.island_first[island + 1]
    return int(last - first > 1 or state.soft.body_touches_itself[state.contact.island_body[first]] == 1)


@ti.func
def is_outdated(state: ti.template(), island, given, h):
    """Whether a body of an island may be farther than it was searched for after another substep (1).

    What explodes does not count, or others would be searched again because of it.
    Args:
        given: speed that its bodies may get from others [m/s].
        h: substep [s].
    """
    outdated, farthest, nearest_lost = 0, ti.cast(0.0, ti.f32), ti.cast(NO_CONTACT, ti.f32)
    for i in range(state.contact.island_first[island], state.contact.island_first[island + 1]):
        body = state.contact.island_body[i]
        if state.contact.is_exploding[body] == 0:
            speed = ti.max(given, state.contact.body_speed_beside[body])
            gone = state.soft.body_gone[body] + h * speed
            farthest = ti.max(farthest, gone)
            nearest_lost = ti.min(nearest_lost, state.soft.body_lost[body] - gone)
            if not (gone <= state.soft.body_reach[body]):
                outdated = 1
    return outdated | int(nearest_lost < farthest)


@ti.func
def begin_search(state: ti.template(), body, given, h, left, forgets):
    """Forget (1) the candidates of a body, and find the boxes that `search_body` looks at.

    Args:
        given: speed that it may get from others [m/s].
        h, left: substep, and time until the end of the step [s].
    """
    if forgets == 1:
        forget_candidates(state, body)
    _find_box(state, body)
    speed, edge = state.contact.body_speed_beside[body], state.soft.body_surface[body].z
    speed *= 1.0 - state.contact.is_exploding[body]
    way = ti.min(ti.max(FORESIGHT * left * speed, SHORTEST * edge), LONGEST * edge)
    state.soft.body_reach[body] = ti.max(way, h * speed) + h * given
    state.soft.body_gone[body] = 0.0
    state.soft.body_lost[body] = NO_CONTACT


@ti.func
def note_way(state: ti.template(), body, shared):
    """Note how far a body is from where it was searched, beside the way [m] that its island `shared`.

    The length of its path would be much more: a pile of soft bodies is never quite still.
    """
    particles = state.body_particles[body]
    farthest = ti.Vector.zero(ti.f32, LANES)
    for block in range((particles[1] - particles[0] + LANES - 1) // LANES):
        first = (particles[0] + block * LANES) & ROW_BITS
        count, gone = particles[1] - first, ti.Vector.zero(ti.f32, LANES)
        for lane in range(LANES):
            way = state.particle_position[first + lane] - state.soft.searched_position[first + lane] - shared
            gone[lane] = ti.select(lane < count, way.norm(), 0.0)
        for lane in range(ti.min(count, LANES)):
            state.soft.particle_gone[first + lane] = gone[lane]
        farthest = ti.max(farthest, gone)
    state.soft.body_gone[body] = farthest.max()
