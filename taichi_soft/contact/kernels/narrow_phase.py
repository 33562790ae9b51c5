"""Narrow phase: find the candidates that are contacts in this substep, with their gaps and normals.

First, the candidates within range are listed. Then their gaps are computed, and contacts are selected vertex
by vertex. Both passes process `LANES` candidates at a time in SIMD lanes, as in `elastic`.

Groups of fields: reads hull, islands; writes soft.
"""

from taichi_soft.contact.fields import NO_CONTACT, SLOTS
from taichi_soft.contact.kernels.contact_solver import precompute_contact
from taichi_soft.core.constants import LANES, ROW_BITS
from taichi_soft.core.math.finite import is_finite
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.math.triangle import closest_point_on_triangle
from taichi_soft.core.runtime import ti

OUTSIDE = 1e-4
"""Smallest barycentric coordinate at which the nearest point counts as inside the triangle."""

SAME_NORMAL = 0.7
"""Cosine of the angle between the normals of two contacts of a vertex, above which the two count as one
contact. A flat surface therefore gives one contact for any triangulation, and a corner gives two."""

SAME_NORMAL_INSIDE = 0.95
"""`SAME_NORMAL` for a vertex whose nearest points lie inside both triangles. Such a vertex is in a valley or
a dent, or touches two bodies. Both sides of a valley must support the vertex. In a dent, several contacts
would make the vertex oscillate."""

MIN_ADVANTAGE = 0.01
"""Distance, relative to the thickness, by which a contact at an edge must be nearer than a contact with a
load in order to replace that contact."""


@ti.func
def _list_near_candidates(state: ti.template(), body, impact_speed, h):
    """List the candidates of a body that can touch within the substep. Returns: the number of candidates.

    Args:
        impact_speed: speed that either body can gain from impacts [m/s].
        h: substep [s].
    """
    first_slot, slots, count = state.touching.body_outer[body][0] * SLOTS, state.soft.slot_count[body], 0
    for block in range((slots + LANES - 1) // LANES):
        first = (first_slot + block * LANES) & ROW_BITS
        is_near = ti.Vector.zero(ti.i32, LANES)
        for lane in range(LANES):
            who = state.soft.slot_vertices[first + lane]
            travelled, speed = ti.cast(0.0, ti.f32), ti.cast(impact_speed, ti.f32)
            for i in ti.static(range(1, 4)):
                travelled = ti.max(travelled, state.soft.particle_gone[who[i]])
                speed = ti.max(speed, state.particle_speed[who[i]])
            travelled += state.soft.particle_gone[who[0]]
            approach = h * (speed + ti.max(impact_speed, state.particle_speed[who[0]]))
            is_near[lane] = ti.cast(state.soft.slot_spare[first + lane] < travelled + approach, ti.i32)
        for lane in range(ti.min(LANES, slots - block * LANES)):
            # Branch-free: the branch mispredicts too often.
            state.soft.near_slot[first_slot + count] = first + lane
            count += is_near[lane]
    return count


@ti.func
def _measure_gap(state: ti.template(), slot):
    """Compute the position of a candidate's vertex relative to its triangle.

    Returns: contact normal; distance [m], negative behind the triangle; barycentric coordinates of the
    nearest point; 1 if contact is possible, else 0.

    Contact is not possible for a vertex behind an edge of the triangle. Such a vertex has contact with
    another triangle, or is outside.
    """
    who = state.soft.slot_vertices[slot]
    x = state.particle_position[who[0]]
    a, b, c = (
        state.particle_position[who[1]],
        state.particle_position[who[2]],
        state.particle_position[who[3]],
    )
    weights = closest_point_on_triangle(x, a, b, c)
    separation = x - weights.x * a - weights.y * b - weights.z * c
    face = (b - a).cross(c - a)
    length = face.norm()
    face = face / ti.max(length, 1e-30)
    side, away = separation.dot(face), separation.norm()
    is_over = weights.min() > OUTSIDE
    distance = ti.select(is_over, side, away)
    normal = ti.select(is_over or side < 0.0 or away <= 1e-9, face, separation / ti.max(away, 1e-30))
    can_touch = int(is_over or side >= 0.0) & int(length > 0.0) & is_finite(separation) & is_finite(face)
    return normal, distance, weights, can_touch


@ti.func
def _contact_range(state: ti.template(), slot, impact_speed, h):
    """Return the distance [m] at which a vertex and a triangle touch, and the distance [m] by which they can
    approach each other within the substep.

    If one of the two bodies explodes, the second distance is -NO_CONTACT, so that the two never touch.
    """
    who = state.soft.slot_vertices[slot]
    mine, other = state.particle_body[who[0]], state.particle_body[who[1]]
    thickness = 0.5 * (state.body_surface[mine].y + state.body_surface[other].y)
    speed = ti.cast(impact_speed, ti.f32)
    for i in ti.static(range(1, 4)):
        speed = ti.max(speed, state.particle_speed[who[i]])
    approach = h * (speed + ti.max(impact_speed, state.particle_speed[who[0]]))
    is_exploding = state.islands.is_exploding[mine] + state.islands.is_exploding[other]
    return thickness, ti.select(is_exploding > 0, -NO_CONTACT, approach)


@ti.func
def _clear_impulses(soft: ti.template(), slot):
    soft.slot_normal_impulse[slot] = 0.0
    soft.slot_friction_impulse[slot] = ti.Vector.zero(ti.f32, 3)


@ti.func
def _merge_contacts(soft: ti.template(), lost, kept):
    """End the contact in slot `lost` and add its impulses to the contact in slot `kept`."""
    soft.slot_gap[lost] = NO_CONTACT
    soft.slot_normal_impulse[kept] = soft.slot_normal_impulse[kept] + soft.slot_normal_impulse[lost]
    soft.slot_friction_impulse[kept] = soft.slot_friction_impulse[kept] + soft.slot_friction_impulse[lost]
    _clear_impulses(soft, lost)


@ti.func
def _merge_duplicate_contacts(soft: ti.template(), first, at, lead):
    """Merge a contact with earlier contacts of the same vertex that have about the same normal.

    The nearest contact remains and receives the impulses of the others, so that a vertex that crosses an edge
    stays supported. In front of an edge, the distances to both triangles are equal up to rounding. The
    triangle that carries the load then keeps its contact. The other triangle would distribute friction to
    other corners, and the jolt of each change would prevent heaps from coming to rest.

    Args:
        first, at: rows in `near_slot` of the vertex's first contact and of the contact to merge.
        lead: distance by which a contact at an edge must be nearer than a contact with a load [m].
    """
    slot = soft.near_slot[at]
    is_inside = int(soft.slot_weights[slot].min() > OUTSIDE)
    for row in range(first, at):
        other = soft.near_slot[row]
        if soft.slot_gap[other] < NO_CONTACT:
            inside = is_inside + int(soft.slot_weights[other].min() > OUTSIDE)
            same = ti.select(inside == 2, SAME_NORMAL_INSIDE, SAME_NORMAL)
            if soft.slot_normal[other].dot(soft.slot_normal[slot]) > same:
                bears = int(soft.slot_normal_impulse[other] > 0.0) - int(soft.slot_normal_impulse[slot] > 0.0)
                ahead = ti.select(inside == 0, bears * lead, 0.0)
                kept, lost = other, slot
                if soft.slot_gap[other] > soft.slot_gap[slot] + ahead:
                    kept, lost = slot, other
                _merge_contacts(soft, lost, kept)


@ti.func
def _is_in_front(state: ti.template(), first, at, slot, depth, behind):
    """1 if a vertex `depth` [m] behind a triangle is nearer to the front of another triangle of the same
    body.

    Such a vertex is outside the body. If a part of the body is thinner than the search range, a vertex in
    front of the part also finds the triangles on the far side.
    Args:
        first, at: rows in `near_slot` of the vertex's first contact and of the contact in `slot`.
        behind: slot of the vertex's current contact from behind, or -1.
    """
    body, is_outside = state.particle_body[state.soft.slot_vertices[slot][1]], 0
    for row in range(first, at):
        other = state.soft.near_slot[row]
        if other != behind and state.soft.slot_gap[other] < depth:
            is_outside |= int(state.particle_body[state.soft.slot_vertices[other][1]] == body)
    return is_outside


@ti.func
def _select_contacts(state: ti.template(), body, count, impact_speed, h):
    """Select contacts among the near candidates.

    A vertex in front of triangles has contact with all of them. A vertex behind triangles has contact only
    with the nearest of them. This contact is ignored if the vertex is nearer to the front of another triangle
    of the same body.

    Args:
        count: number of near candidates.
        impact_speed, h: see `_list_near_candidates`.
    """
    first_slot = state.touching.body_outer[body][0] * SLOTS
    vertex, first_row, shallowest, behind = -1, first_slot, ti.cast(-1e30, ti.f32), -1
    for block in range((count + LANES - 1) // LANES):
        first = (first_slot + block * LANES) & ROW_BITS
        normals = ti.Matrix.zero(ti.f32, LANES, 4)  # normals and distances
        feet = ti.Matrix.zero(ti.f32, LANES, 4)  # weights of nearest points, and 1 if contact is possible
        for lane in range(LANES):
            normal, distance, weights, can_touch = _measure_gap(state, state.soft.near_slot[first + lane])
            for i in ti.static(range(3)):
                normals[lane, i] = normal[i]
                feet[lane, i] = weights[i]
            normals[lane, 3] = distance
            feet[lane, 3] = ti.cast(can_touch, ti.f32)
        for lane in range(ti.min(LANES, count - block * LANES)):
            slot, distance = state.soft.near_slot[first + lane], normals[lane, 3]
            p, other = state.soft.slot_vertices[slot][0], state.soft.slot_vertices[slot][1]
            if p != vertex:
                vertex, first_row, shallowest, behind = p, first + lane, -1e30, -1
            thickness, approach = _contact_range(state, slot, impact_speed, h)
            state.soft.slot_gap[slot] = NO_CONTACT
            if feet[lane, 3] > 0.0 and distance <= thickness + approach:
                if distance >= 0.0:
                    for i in ti.static(range(3)):
                        state.soft.slot_normal[slot][i] = normals[lane, i]
                        state.soft.slot_weights[slot][i] = feet[lane, i]
                    state.soft.slot_gap[slot] = distance - thickness
                    _merge_duplicate_contacts(state.soft, first_row, first + lane, MIN_ADVANTAGE * thickness)
                    if behind >= 0 and distance < -shallowest:
                        before = state.soft.slot_vertices[behind][1]
                        if state.particle_body[before] == state.particle_body[other]:
                            state.soft.slot_gap[behind] = NO_CONTACT
                            shallowest, behind = -1e30, -1
                elif (
                    state.particle_body[other] != body
                    and distance > shallowest
                    and _is_in_front(state, first_row, first + lane, slot, -distance, behind) == 0
                ):
                    for i in ti.static(range(3)):
                        state.soft.slot_normal[slot][i] = normals[lane, i]
                        state.soft.slot_weights[slot][i] = feet[lane, i]
                    if behind >= 0:
                        if state.soft.slot_normal[behind].dot(state.soft.slot_normal[slot]) > SAME_NORMAL:
                            _merge_contacts(state.soft, behind, slot)
                        state.soft.slot_gap[behind] = NO_CONTACT
                    state.soft.slot_gap[slot] = distance - thickness
                    shallowest, behind = distance, slot


@ti.real_func
def find_contacts(state: ti.template(), body: ti.i32, impact_speed: ti.f32, h: ti.f32):
    """List the contacts of a body's vertices. For `impact_speed` and `h`, see `_list_near_candidates`."""
    first_slot, before = state.touching.body_outer[body][0] * SLOTS, state.soft.contact_count[body]
    near = _list_near_candidates(state, body, impact_speed, h)
    for k in range(first_slot, first_slot + before):
        state.soft.slot_gap[state.soft.contact_slot[k]] = NO_CONTACT
    _select_contacts(state, body, near, impact_speed, h)
    # Clear the impulses of ended contacts. Otherwise a later contact in the same slot would start with them.
    for k in range(first_slot, first_slot + before):
        slot = state.soft.contact_slot[k]
        if state.soft.slot_gap[slot] >= NO_CONTACT:
            _clear_impulses(state.soft, slot)
    count, near_row = 0, first_slot
    while near_row < first_slot + near:
        slot = state.soft.near_slot[near_row]
        if state.soft.slot_gap[slot] < NO_CONTACT:
            precompute_contact(state, slot)
            state.soft.contact_slot[first_slot + count] = slot
            count += 1
        else:
            _clear_impulses(state.soft, slot)  # an earlier merge can have added impulses
        near_row = row_behind(near_row)
    state.soft.contact_count[body] = count
