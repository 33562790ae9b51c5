"""Lists of candidates: the triangles near each vertex, and the edges near each contact edge.

A list stays valid until its body has moved too far.

Groups of fields: reads hull; writes soft.
"""

from taichi_soft.contact.fields import FOUND, NO_CONTACT, SLOTS
from taichi_soft.contact.kernels.features import (
    edge_of,
    end_feature,
    first_edge_feature,
    first_feature,
    first_slot_of,
    vertex_of,
)
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti

SHORTEST, LONGEST = 0.1, 0.3
"""Smallest and largest margin of a search, in mean edges."""


@ti.func
def clear_kept_impulses(state: ti.template(), body):
    """Clear the impulses with which the contacts of a body start after a search."""
    vertex = state.touching.body_outer[body][0]
    while vertex < state.touching.body_outer[body][1]:
        state.soft.kept_normal_impulse[state.touching.outer_particle[vertex]] = 0.0
        vertex = row_behind(vertex)
    edge = state.soft.body_edges[body][0]
    while edge < state.soft.body_edges[body][1]:
        state.soft.kept_edge_normal_impulse[edge] = 0.0
        edge = row_behind(edge)


@ti.real_func
def clear_candidates(state: ti.template(), body: ti.i32):
    """Clear the candidates of a body, and store the impulses of its contacts.

    After the next search, contacts start from these impulses. Otherwise, bodies would sag a little in each
    step, and a heap would never come to rest.
    """
    clear_kept_impulses(state, body)
    first_slot, first_edge = first_slot_of(state, body), first_edge_feature(state, body)
    for k in range(first_slot, first_slot + state.soft.contact_count[body]):
        slot = state.soft.contact_slot[k]
        feature, impulse = state.soft.slot_feature[slot], state.soft.slot_normal_impulse[slot]
        if feature < first_edge:
            p = state.soft.slot_points[slot].x
            if impulse > state.soft.kept_normal_impulse[p]:
                state.soft.kept_triangle[p] = state.soft.slot_partner[slot]
                state.soft.kept_normal_impulse[p] = impulse
                state.soft.kept_friction_impulse[p] = state.soft.slot_friction_impulse[slot]
        else:
            e = edge_of(state, body, feature)
            if impulse > state.soft.kept_edge_normal_impulse[e]:
                state.soft.kept_edge[e] = state.soft.slot_partner[slot]
                state.soft.kept_edge_normal_impulse[e] = impulse
                state.soft.kept_edge_friction_impulse[e] = state.soft.slot_friction_impulse[slot]
    state.soft.slot_count[body] = 0
    state.soft.vertex_slot_count[body] = 0
    state.soft.contact_count[body] = 0


@ti.func
def _farthest_found(soft: ti.template(), k):
    """Return the row in `found_partner` of the farthest triangle that the search found for a vertex."""
    farthest = k * FOUND
    row = farthest + 1
    while row < k * FOUND + soft.found_count[k]:
        if soft.found_distance[row] > soft.found_distance[farthest]:
            farthest = row
        row = row_behind(row)
    return farthest


@ti.func
def insert_candidate(soft: ti.template(), k, triangle, distance):
    """Insert a triangle into the list of a vertex. A full list drops the farthest triangle.

    Args: k: row of the vertex. distance: distance of the triangle from the vertex [m].
    Returns: distance of the dropped triangle [m]; `NO_CONTACT` if no triangle was dropped.
    """
    row, lost = k * FOUND + soft.found_count[k], ti.cast(NO_CONTACT, ti.f32)
    if soft.found_count[k] == FOUND:
        row = _farthest_found(soft, k)
        lost = ti.max(soft.found_distance[row], distance)
    else:
        soft.found_count[k] = soft.found_count[k] + 1
    if distance < lost:
        soft.found_partner[row] = triangle
        soft.found_distance[row] = distance
    return lost


@ti.func
def record_lost(state: ti.template(), body, distance, thickness):
    """Record that the list of a vertex dropped a triangle, so that the next search starts early enough.

    Args:
        distance: distance between the vertex and the triangle [m].
        thickness: distance at which the bodies touch [m].
    """
    allowance = ti.max(distance - thickness, 2.0 * SHORTEST * state.body_surface[body].z)
    state.soft.body_lost[body] = ti.min(state.soft.body_lost[body], allowance)


@ti.func
def _points_of_candidate(state: ti.template(), body, feature, partner, is_edge):
    """Return the four points of a contact between a feature of a body and a partner."""
    points = ti.Vector.zero(ti.i32, 4)
    if is_edge:
        mine, theirs = (
            state.soft.edge_corners[edge_of(state, body, feature)],
            state.soft.edge_corners[partner],
        )
        points = ti.Vector([mine.x, mine.y, theirs.x, theirs.y])
    else:
        corners = state.touching.triangle_vertices[partner]
        points = ti.Vector([vertex_of(state, body, feature), corners.x, corners.y, corners.z])
    return points


@ti.func
def _kept_impulses(state: ti.template(), body, feature, partner, p, is_edge):
    """Return the normal impulse and friction impulse that a contact had before the search [N s]."""
    normal_impulse, friction_impulse = ti.cast(0.0, ti.f32), ti.Vector.zero(ti.f32, 3)
    if is_edge:
        e = edge_of(state, body, feature)
        if state.soft.kept_edge_normal_impulse[e] > 0.0 and state.soft.kept_edge[e] == partner:
            normal_impulse = state.soft.kept_edge_normal_impulse[e]
            friction_impulse = state.soft.kept_edge_friction_impulse[e]
    elif state.soft.kept_normal_impulse[p] > 0.0 and state.soft.kept_triangle[p] == partner:
        normal_impulse = state.soft.kept_normal_impulse[p]
        friction_impulse = state.soft.kept_friction_impulse[p]
    return normal_impulse, friction_impulse


@ti.func
def list_candidates(state: ti.template(), body, thickness):
    """Make the triangles and edges that the search found for a body its candidates, and restore impulses.

    If the body has too few slots, each feature keeps at most its `SLOTS` nearest partners.
    Args:
        thickness: largest distance at which the body touches another body [m].
    """
    first, first_edge, end = (
        first_feature(state, body),
        first_edge_feature(state, body),
        end_feature(state, body),
    )
    total, feature = 0, first
    while feature < end:
        total += state.soft.found_count[feature]
        feature = row_behind(feature)
    is_too_much = total > (end - first) * SLOTS
    slot, contacts, vertex_slots = first * SLOTS, 0, 0
    for f in range(first, end):
        if f == first_edge:
            vertex_slots = slot - first * SLOTS
        while is_too_much and state.soft.found_count[f] > SLOTS:
            farthest, last = _farthest_found(state.soft, f), f * FOUND + state.soft.found_count[f] - 1
            record_lost(state, body, state.soft.found_distance[farthest], thickness)
            state.soft.found_partner[farthest] = state.soft.found_partner[last]
            state.soft.found_distance[farthest] = state.soft.found_distance[last]
            state.soft.found_count[f] = state.soft.found_count[f] - 1
        row = f * FOUND
        while row < f * FOUND + state.soft.found_count[f]:
            partner, is_edge = state.soft.found_partner[row], f >= first_edge
            points = _points_of_candidate(state, body, f, partner, is_edge)
            other = state.particle_body[points.w]
            mutual = 0.5 * (state.body_surface[body].y + state.body_surface[other].y)
            state.soft.slot_points[slot] = points
            state.soft.slot_feature[slot] = f
            state.soft.slot_partner[slot] = partner
            state.soft.slot_spare[slot] = state.soft.found_distance[row] - mutual
            state.soft.slot_normal[slot] = ti.Vector.zero(ti.f32, 3)
            normal_impulse, friction_impulse = _kept_impulses(state, body, f, partner, points.x, is_edge)
            state.soft.slot_normal_impulse[slot] = normal_impulse
            state.soft.slot_friction_impulse[slot] = friction_impulse
            if normal_impulse > 0.0:
                state.soft.contact_slot[first * SLOTS + contacts] = slot
                contacts += 1
            slot += 1
            row = row_behind(row)
    state.soft.slot_count[body] = slot - first * SLOTS
    if first_edge == end:
        vertex_slots = slot - first * SLOTS
    state.soft.vertex_slot_count[body] = vertex_slots
    state.soft.contact_count[body] = contacts
