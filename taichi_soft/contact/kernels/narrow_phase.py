"""Narrow phase: find the candidates that are contacts in this substep, with their gaps and normals.

Groups of fields: writes soft.
"""

from taichi_soft.contact.fields import NO_CONTACT
from taichi_soft.contact.kernels.contact_solver import precompute_masses
from taichi_soft.contact.kernels.edge_contacts import select_edge_contact
from taichi_soft.contact.kernels.features import first_slot_of
from taichi_soft.contact.kernels.near_candidates import list_near_candidates
from taichi_soft.contact.kernels.vertex_contacts import (
    clear_impulses,
    precompute_vertex_contact,
    select_vertex_contacts,
)
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti


@ti.real_func
def find_contacts(state: ti.template(), body: ti.i32, impact_speed: ti.f32, h: ti.f32):
    """List the contacts of a body's features. For `impact_speed` and `h`, see `list_near_candidates`."""
    first, before = first_slot_of(state, body), state.soft.contact_count[body]
    slots, vertex_slots = state.soft.slot_count[body], state.soft.vertex_slot_count[body]
    of_vertices = list_near_candidates(state, first, vertex_slots, first, False, impact_speed, h)
    near = of_vertices
    if vertex_slots < slots:
        first_edge_slot = first + vertex_slots
        near += list_near_candidates(
            state, first_edge_slot, slots - vertex_slots, first + near, True, impact_speed, h
        )
    for k in range(first, first + before):
        state.soft.slot_gap[state.soft.contact_slot[k]] = NO_CONTACT
    select_vertex_contacts(state, body, of_vertices, impact_speed, h)
    near_row = first + of_vertices
    while near_row < first + near:
        select_edge_contact(state, body, state.soft.near_slot[near_row], impact_speed, h)
        near_row = row_behind(near_row)
    # Clear the impulses of ended contacts. Otherwise a later contact in the same slot would start with them.
    for k in range(first, first + before):
        slot = state.soft.contact_slot[k]
        if state.soft.slot_gap[slot] >= NO_CONTACT:
            clear_impulses(state.soft, slot)
    count, near_row = 0, first
    while near_row < first + near:
        slot = state.soft.near_slot[near_row]
        if state.soft.slot_gap[slot] < NO_CONTACT:
            if near_row < first + of_vertices:
                precompute_vertex_contact(state, slot)
            precompute_masses(state, slot)
            state.soft.contact_slot[first + count] = slot
            count += 1
        else:
            clear_impulses(state.soft, slot)  # an earlier merge can have added impulses
        near_row = row_behind(near_row)
    state.soft.contact_count[body] = count
