"""Lists of candidates: the triangles near each vertex. A list stays valid until its body has moved too far.

Groups of fields: reads hull; writes soft.
"""

from taichi_soft.contact.fields import FOUND, NO_CONTACT, SLOTS
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti

SHORTEST, LONGEST = 0.1, 0.3
"""Smallest and largest margin of a search, in mean edges."""


@ti.real_func
def clear_candidates(state: ti.template(), body: ti.i32):
    """Clear the candidates of a body's vertices, and store the impulses of its contacts.

    After the next search, contacts start from these impulses. Otherwise, bodies would sag a little in each
    step, and a heap would never come to rest.
    """
    outer = state.touching.body_outer[body]
    vertex = outer[0]
    while vertex < outer[1]:
        state.soft.kept_normal_impulse[state.touching.outer_particle[vertex]] = 0.0
        vertex = row_behind(vertex)
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
    """Return the row in `found_triangle` of the farthest triangle that the search found for a vertex."""
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
        soft.found_triangle[row] = triangle
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
def list_candidates(state: ti.template(), body, thickness):
    """Make the triangles that the search found for a body its candidates, and restore contact impulses.

    If the body has too few slots, each vertex keeps at most its `SLOTS` nearest triangles.
    Args:
        thickness: largest distance at which the body touches another body [m].
    """
    outer = state.touching.body_outer[body]
    total, vertex = 0, outer[0]
    while vertex < outer[1]:
        total += state.soft.found_count[vertex]
        vertex = row_behind(vertex)
    is_too_much = total > (outer[1] - outer[0]) * SLOTS
    slot, contacts = outer[0] * SLOTS, 0
    for k in range(outer[0], outer[1]):
        while is_too_much and state.soft.found_count[k] > SLOTS:
            farthest, last = _farthest_found(state.soft, k), k * FOUND + state.soft.found_count[k] - 1
            record_lost(state, body, state.soft.found_distance[farthest], thickness)
            state.soft.found_triangle[farthest] = state.soft.found_triangle[last]
            state.soft.found_distance[farthest] = state.soft.found_distance[last]
            state.soft.found_count[k] = state.soft.found_count[k] - 1
        p = state.touching.outer_particle[k]
        row = k * FOUND
        while row < k * FOUND + state.soft.found_count[k]:
            triangle = state.soft.found_triangle[row]
            corners = state.touching.triangle_vertices[triangle]
            other = state.particle_body[corners[0]]
            mutual = 0.5 * (state.body_surface[body].y + state.body_surface[other].y)
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
            row = row_behind(row)
    state.soft.slot_count[body] = slot - outer[0] * SLOTS
    state.soft.contact_count[body] = contacts
