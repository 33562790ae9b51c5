"""Broad phase: find vertices near triangles, and contact edges near contact edges.

If the boxes of two bodies overlap, the vertices of the first body that can be near the second body are sorted
into a grid. Each triangle of the second body then queries this grid. The candidates of a body stay valid
until one of its vertices has travelled farther than the margin of the body.

Groups of fields: reads hull, islands; writes soft.
"""

from taichi_soft.bodies.contact_edges import SLIM
from taichi_soft.contact.fields import NO_CONTACT
from taichi_soft.contact.kernels.candidates import (
    LONGEST,
    SHORTEST,
    clear_candidates,
    insert_candidate,
    list_candidates,
    record_lost,
)
from taichi_soft.contact.kernels.feature_grid import (
    MAX_QUERY_EDGES,
    boxes_overlap,
    cell_of,
    edge_size,
    fill_grid,
    update_boxes,
)
from taichi_soft.contact.kernels.features import (
    edge_of,
    first_edge_feature,
    first_feature,
    vertex_of,
)
from taichi_soft.contact.kernels.filters import may_touch
from taichi_soft.contact.kernels.hull_points import is_held
from taichi_soft.contact.kernels.parting import are_parting
from taichi_soft.control.kernels.joints import are_joined
from taichi_soft.core.constants import LANES, ROW_BITS
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.math.segment import closest_points_on_segments
from taichi_soft.core.math.triangle import closest_point_on_triangle
from taichi_soft.core.runtime import ti

SEARCH_MARGIN = 1.25
"""Ratio of the search margin to the path of the body's fastest vertex until the end of the step."""


SELF_DISTANCE = 1.5
"""Distance at rest, in mean edges, below which a vertex and a triangle of the same body never collide."""


@ti.func
def _is_self_neighbour(state: ti.template(), p, corners, edge):
    """True if a vertex and a triangle of the same body are near each other at rest."""
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
    """Add a triangle of `other` to the candidates of the vertices of `body` that are within `margin` [m].

    The grid spans from `lowest` to `highest`. If `is_joined` is 1, particles in a joint are skipped, so that
    contact does not act against the joint.
    """
    lower = ti.max(state.soft.triangle_lower[triangle] - margin, lowest)
    upper = ti.min(state.soft.triangle_upper[triangle] + margin, highest)
    if (upper - lower).max() <= MAX_QUERY_EDGES * ti.max(state.body_surface[other].z, 1e-6):
        corners = state.touching.triangle_vertices[triangle]
        a = state.particle_position[corners[0]]
        b = state.particle_position[corners[1]]
        c = state.particle_position[corners[2]]
        is_joint_there = 0
        for i in ti.static(range(3)):
            is_joint_there = is_joint_there | is_held(state, corners[i])
        low, high = cell_of(lower, lowest, cells, cell), cell_of(upper, lowest, cells, cell)
        for cz in range(low.z, high.z + 1):
            for cy in range(low.y, high.y + 1):
                row = table[0] + (cz * cells.y + cy) * cells.x  # cells along x are contiguous
                first, last = state.soft.cell_first[row + low.x], state.soft.cell_first[row + high.x + 1]
                for item in range(first, last):
                    x = state.soft.cell_position[item]
                    wanted = ti.max(lower - x, x - upper).max() <= 0.0
                    k = state.soft.cell_item[item]
                    p = vertex_of(state, body, k)
                    if wanted and is_joined == 1:
                        wanted = is_joint_there | is_held(state, p) == 0
                    if wanted and other == body:
                        edge = state.body_surface[other].z
                        wanted = not _is_self_neighbour(state, p, corners, edge)
                    if wanted:
                        weights = closest_point_on_triangle(x, a, b, c)
                        gap = (x - weights.x * a - weights.y * b - weights.z * c).norm()
                        if gap < margin:
                            lost = insert_candidate(state.soft, k, triangle, gap)
                            if lost < NO_CONTACT:
                                record_lost(state, body, lost, thickness)


@ti.func
def _table_of(state: ti.template(), body):
    """Return the first rows of a body in `cell_first` and `item`."""
    first = first_feature(state, body)
    return ti.Vector([4 * first + body, first])


@ti.func
def _search_pair(state: ti.template(), body, other, margin, thickness):
    """Find the vertices of `body` within `margin` [m] of triangles of `other`.

    The bodies touch at a distance of `thickness` [m].
    """
    first_row, end = first_feature(state, body), first_edge_feature(state, body)
    table = _table_of(state, body)
    count, lowest, highest, cells, cell = fill_grid(state, table, body, other, first_row, end, margin)
    if count > 0:
        is_joined = are_joined(state, body, other)
        triangles = state.touching.body_triangles[other]
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


@ti.func
def _are_self_neighbours(state: ti.template(), mine, theirs, edge):
    """True if two edges of the same body are near each other at rest. `mine` and `theirs` are their ends."""
    p, q = state.rest_position[mine.x], state.rest_position[theirs.x]
    d, e = state.rest_position[mine.y] - p, state.rest_position[theirs.y] - q
    s, t = closest_points_on_segments(p, d, q, e)
    return (p + s * d - q - t * e).norm() < SELF_DISTANCE * edge


@ti.func
def _can_cross(state: ti.template(), mine, is_sharp, theirs, is_their_sharp):
    """Return 1 if two edges can cross where no vertex is near: both are sharp, or one is slim, see `SLIM`."""
    can_cross = is_sharp and is_their_sharp
    if is_sharp != is_their_sharp:
        slim, flat = ti.select(is_sharp, mine, theirs), ti.select(is_sharp, theirs, mine)
        length2, height2 = edge_size(state, slim)
        flat2, _ = edge_size(state, flat)
        can_cross = height2 <= flat2 and (height2 == 0.0 or length2 >= SLIM * SLIM * flat2)
    return int(can_cross)


@ti.func
def _insert_edge(state: ti.template(), body, other, is_joined, feature, partner, margin, thickness):
    """Add a contact edge of `other` to the candidates of an edge of `body` if it is within `margin` [m]."""
    own = edge_of(state, body, feature)
    mine, theirs = state.soft.edge_corners[own].xy, state.soft.edge_corners[partner].xy
    is_sharp = own < state.soft.body_sharp_end[body]
    is_their_sharp = partner < state.soft.body_sharp_end[other]
    wanted = _can_cross(state, own, is_sharp, partner, is_their_sharp)
    if wanted == 1 and is_joined == 1:
        held = is_held(state, mine.x) | is_held(state, mine.y)
        wanted = int(held | is_held(state, theirs.x) | is_held(state, theirs.y) == 0)
    if wanted == 1 and other == body:
        wanted = int(own < partner)
        if wanted == 1:
            wanted = int(not _are_self_neighbours(state, mine, theirs, state.body_surface[body].z))
    if wanted == 1:
        p, q = state.particle_position[mine.x], state.particle_position[theirs.x]
        d, e = state.particle_position[mine.y] - p, state.particle_position[theirs.y] - q
        s, t = closest_points_on_segments(p, d, q, e)
        gap = (p + s * d - q - t * e).norm()
        if gap < margin:
            lost = insert_candidate(state.soft, feature, partner, gap)
            if lost < NO_CONTACT:
                record_lost(state, body, lost, thickness)


@ti.func
def _edges_against(state: ti.template(), body, other):
    """Return the number of a body's contact edges that can touch another body: all edges if it is slim."""
    end = state.soft.body_sharp_end[body]
    if other != body and state.soft.body_is_slim[other] == 1:
        end = state.soft.body_edges[body][1]
    return end - state.soft.body_edges[body][0]


@ti.real_func
def _search_edges(state: ti.template(), body: ti.i32, other: ti.i32, margin: ti.f32, thickness: ti.f32):
    """Find the contact edges of `body` within `margin` [m] of contact edges of `other`.

    The candidates belong to the body with the smaller number.
    """
    first_row, first_of_other = first_edge_feature(state, body), state.soft.body_edges[other][0]
    end = first_row + _edges_against(state, body, other)
    their_end = first_of_other + _edges_against(state, other, body)
    if first_row < end and first_of_other < their_end:
        reach = margin + state.soft.body_half_edge[body]
        table = _table_of(state, body)
        count, lowest, highest, cells, cell = fill_grid(state, table, body, other, first_row, end, reach)
        if count > 0:
            is_joined = are_joined(state, body, other)
            for partner in range(first_of_other, their_end):
                ends = state.soft.edge_corners[partner].xy
                a, b = state.particle_position[ends[0]], state.particle_position[ends[1]]
                lower = ti.max(ti.min(a, b) - reach, lowest)
                upper = ti.min(ti.max(a, b) + reach, highest)
                size = (upper - lower).max()
                if (upper - lower).min() >= 0.0 and size <= MAX_QUERY_EDGES * ti.max(cell, 1e-6):
                    low, high = cell_of(lower, lowest, cells, cell), cell_of(upper, lowest, cells, cell)
                    for cz in range(low.z, high.z + 1):
                        for cy in range(low.y, high.y + 1):
                            row = table[0] + (cz * cells.y + cy) * cells.x
                            first = state.soft.cell_first[row + low.x]
                            for item in range(first, state.soft.cell_first[row + high.x + 1]):
                                x = state.soft.cell_position[item]
                                if ti.max(lower - x, x - upper).max() <= 0.0:
                                    feature = state.soft.cell_item[item]
                                    _insert_edge(
                                        state, body, other, is_joined, feature, partner, margin, thickness
                                    )


@ti.real_func
def search_body(state: ti.template(), body: ti.i32, island: ti.i32):
    """Find the candidates of a body's vertices. Call this after `begin_search` for all bodies of the
    island.
    """
    lower, upper = state.body_bounds_lower[body], state.body_bounds_upper[body]
    thickest = ti.cast(0.0, ti.f32)
    for j in range(state.islands.first[island], state.islands.first[island + 1]):
        other = state.islands.body[j]
        thickness = 0.5 * (state.body_surface[body].y + state.body_surface[other].y)
        thickest = ti.max(thickest, thickness)
        margin = thickness + state.soft.body_reach[body] + state.soft.body_reach[other]
        wanted = state.soft.body_touches_itself[body] == 1
        if other != body:
            their_lower, their_upper = state.body_bounds_lower[other], state.body_bounds_upper[other]
            wanted = may_touch(state, body, other) and boxes_overlap(
                lower - margin, upper + margin, their_lower, their_upper
            )
            if wanted:
                wanted = are_parting(state, body, other) == 0
        if wanted:
            _search_pair(state, body, other, margin, thickness)
            if other >= body:
                _search_edges(state, body, other, margin, thickness)
    list_candidates(state, body, thickest)


@ti.func
def has_contact_pairs(state: ti.template(), island):
    """1 if a body of an island can touch another body or itself."""
    first, last = state.islands.first[island], state.islands.first[island + 1]
    return int(last - first > 1 or state.soft.body_touches_itself[state.islands.body[first]] == 1)


@ti.func
def is_outdated(state: ti.template(), island, impact_speed, h):
    """1 if a vertex can leave the margin of its body in the next substep.

    Exploding bodies are ignored, so that they cause no searches for other bodies.
    Args:
        impact_speed: speed that the island's bodies can gain from impacts [m/s].
        h: substep [s].
    """
    outdated, farthest, nearest_lost = 0, ti.cast(0.0, ti.f32), ti.cast(NO_CONTACT, ti.f32)
    for i in range(state.islands.first[island], state.islands.first[island + 1]):
        body = state.islands.body[i]
        if state.islands.is_exploding[body] == 0:
            speed = ti.max(impact_speed, state.islands.body_speed_beside[body])
            travelled = state.soft.body_gone[body] + h * speed
            farthest = ti.max(farthest, travelled)
            nearest_lost = ti.min(nearest_lost, state.soft.body_lost[body] - travelled)
            if not (travelled <= state.soft.body_reach[body]):
                outdated = 1
    return outdated | int(nearest_lost < farthest)


@ti.real_func
def begin_search(
    state: ti.template(), body: ti.i32, impact_speed: ti.f32, h: ti.f32, left: ti.f32, forgets: ti.i32
):
    """Update the boxes and the margin of a body before `search_body`.

    Args:
        impact_speed: speed that the body can gain from impacts [m/s].
        h, left: substep, and time until the end of the step [s].
        forgets: 1 to clear the candidates of the body first.
    """
    if forgets == 1:
        clear_candidates(state, body)
    update_boxes(state, body)
    speed, edge = state.islands.body_speed_beside[body], state.body_surface[body].z
    speed *= 1.0 - state.islands.is_exploding[body]
    reach = ti.min(ti.max(SEARCH_MARGIN * left * speed, SHORTEST * edge), LONGEST * edge)
    state.soft.body_reach[body] = ti.max(reach, h * speed) + h * impact_speed
    state.soft.body_gone[body] = 0.0
    state.soft.body_lost[body] = NO_CONTACT


@ti.real_func
def update_displacement(state: ti.template(), body: ti.i32, shared: ti.math.vec3):
    """Update the distance of each vertex from its position at the last search.

    This distance is used because the length of the path would grow even in a heap at rest.
    Args: shared: displacement of the whole island, which does not count [m].
    """
    particles = state.body_particles[body]
    farthest, first = ti.Vector.zero(ti.f32, LANES), particles[0] & ROW_BITS
    while first < particles[1]:
        count, travelled = particles[1] - first, ti.Vector.zero(ti.f32, LANES)
        for lane in range(LANES):
            displacement = (
                state.particle_position[first + lane] - state.soft.searched_position[first + lane] - shared
            )
            travelled[lane] = ti.select(lane < count, displacement.norm(), 0.0)
        if count >= LANES:
            for lane in range(LANES):
                state.soft.particle_gone[first + lane] = travelled[lane]
        else:
            lane = 0
            while lane < count:
                state.soft.particle_gone[first + lane] = travelled[lane]
                lane = row_behind(lane)
        farthest = ti.max(farthest, travelled)
        first = (first + LANES) & ROW_BITS  # like `row_behind`, but by a block
    state.soft.body_gone[body] = farthest.max()
    if ti.static(state.capacity.contact.hull):
        for p in range(state.hull.body_points[body][0], state.hull.body_points[body][1]):
            displacement = (state.particle_position[p] - state.soft.searched_position[p] - shared).norm()
            state.soft.particle_gone[p] = displacement
            state.soft.body_gone[body] = ti.max(state.soft.body_gone[body], displacement)
