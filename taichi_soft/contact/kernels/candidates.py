"""Candidates: the triangles near each vertex. The list stays valid until a body has moved too far.

Groups of fields: reads hull; writes soft.
"""

from taichi_soft.contact.fields import FOUND, NO_CONTACT, SLOTS
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti

SHORTEST, LONGEST = 0.1, 0.3
"""Smallest and largest margin of a search, in mean edges."""


@ti.real_func
def clear_candidates(state: ti.template(), body: ti.i32):
    """Clear the candidates of a body's vertices, and store the impulses of its contacts for the next search.

    Contacts start from these impulses after the search. Without them, bodies would sag a little in each step,
    and a heap would never come to rest.
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
    """Return the row of the farthest triangle found for a vertex."""
    farthest = k * FOUND
    row = farthest + 1
    while row < k * FOUND + soft.found_count[k]:
        if soft.found_distance[row] > soft.found_distance[farthest]:
            farthest = row
        row = row_behind(row)
    return farthest


@ti.func
def insert_candidate(soft: ti.template(), k, triangle, distance):
    """Insert a triangle into the list of nearest triangles of a vertex.

    Returns: the distance of the triangle that did not fit [m].
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
    """Record that a triangle `distance` [m] from a vertex of a body did not fit into its list.

    Bodies touch at `thickness` [m]. The body must be searched again before it has moved by the rest of
    `distance`.
    """
    allowance = ti.max(distance - thickness, 2.0 * SHORTEST * state.body_surface[body].z)
    state.soft.body_lost[body] = ti.min(state.soft.body_lost[body], allowance)


@ti.func
def list_candidates(state: ti.template(), body, thickness):
    """Convert the triangles found for the vertices of a body to candidates, and restore the impulses of their
    contacts.

    If there are more triangles than slots of the body, the vertices with the most triangles drop their
    farthest.
    Args:
        thickness: largest thickness at which the body touches another [m].
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
