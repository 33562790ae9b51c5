"""Contacts between vertices and triangles: compute gaps and normals, and select contacts vertex by vertex.

Gaps are computed for `LANES` candidates at a time in SIMD lanes, as in `elastic`.

Groups of fields: writes soft.
"""

from taichi_soft.bodies.kernels.rigid import is_rigid
from taichi_soft.contact.fields import NO_CONTACT
from taichi_soft.contact.kernels.features import first_slot_of
from taichi_soft.contact.kernels.near_candidates import contact_range
from taichi_soft.core.constants import LANES, ROW_BITS
from taichi_soft.core.math.finite import is_finite
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


BESIDE = 0.5
"""Distance beside a face of a rigid body, relative to the thickness, up to which a vertex of another rigid
body touches the face. Faces of boxes in a stack end at the same place, where the true nearest points
flicker."""


@ti.func
def _measure_rigid_gap(state: ti.template(), who, side, face, separation, weights):
    """Compute the gap of a vertex that is beside a triangle, for two rigid bodies.

    The flat face of a rigid body does not round its edges: the normal is that of the face.

    Returns: distance [m]; barycentric coordinates of the vertex's projection; 1 if contact is possible.
    """
    mine, theirs = state.particle_body[who[0]], state.particle_body[who[1]]
    thickness = 0.5 * (state.body_surface[mine].y + state.body_surface[theirs].y)
    a, b, c = (
        state.particle_position[who[1]],
        state.particle_position[who[2]],
        state.particle_position[who[3]],
    )
    across = (b - a).cross(c - a)
    beside = separation - side * face
    scale = 1.0 / ti.max(across.norm(), 1e-30)
    v, w = beside.cross(c - a).dot(face) * scale, (b - a).cross(beside).dot(face) * scale
    feet = weights + ti.Vector([-v - w, v, w])
    return side, feet, int(beside.norm() < BESIDE * thickness) & int(side > -thickness)


@ti.func
def _are_rigid(state: ti.template(), p, q):
    """True if the bodies of two points are rigid, and not the same."""
    mine, theirs, both = state.particle_body[p], state.particle_body[q], False
    if ti.static(state.capacity.contact.rigid):
        both = mine != theirs and is_rigid(state, mine) and is_rigid(state, theirs)
    return both


@ti.real_func
def _choose_face(state: ti.template(), soft: ti.template(), first: ti.i32, at: ti.i32):
    """Keep only one contact of a vertex beside a rigid body: with the face whose plane is the farthest below.

    A contact with a load is preferred, so that contact does not flicker between faces.
    Args: first, at: rows in `near_slot` of the vertex's first contact and of its last one.
    """
    slot = soft.near_slot[at]
    points = soft.slot_points[slot]
    if _are_rigid(state, points[0], points[1]):
        for row in range(first, at):
            other = soft.near_slot[row]
            is_same = state.particle_body[soft.slot_points[other][1]] == state.particle_body[points[1]]
            is_beside = _is_over(soft, slot) + _is_over(soft, other) < 2
            if is_same and is_beside and ti.max(soft.slot_gap[other], soft.slot_gap[slot]) < NO_CONTACT:
                lead = soft.slot_gap[slot] - soft.slot_gap[other]
                loads = int(soft.slot_normal_impulse[slot] > 0.0) - int(soft.slot_normal_impulse[other] > 0.0)
                overs = _is_over(soft, slot) - _is_over(soft, other)
                mutual = state.body_surface[state.particle_body[points[1]]].y
                if lead + (loads + 2 * overs) * mutual > 0.0:
                    _merge_contacts(soft, other, slot)
                else:
                    _merge_contacts(soft, slot, other)


@ti.func
def _measure_gap(state: ti.template(), slot):
    """Compute the position of a candidate's vertex relative to its triangle.

    Returns: contact normal; distance [m], negative behind the triangle; barycentric coordinates of the
    nearest point; 1 if contact is possible, else 0.

    Contact is not possible for a vertex behind an edge of the triangle. Such a vertex has contact with
    another triangle, or is outside.
    """
    who = state.soft.slot_points[slot]
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
    can_touch = int(is_over or side >= 0.0)
    if ti.static(state.capacity.contact.rigid):
        if not is_over and _are_rigid(state, who[0], who[1]):
            normal = face
            distance, weights, can_touch = _measure_rigid_gap(state, who, side, face, separation, weights)
    can_touch = can_touch & int(length > 0.0) & is_finite(separation) & is_finite(face)
    return normal, distance, weights, can_touch


@ti.func
def clear_impulses(soft: ti.template(), slot):
    """Clear the impulses of a contact that ended."""
    soft.slot_normal_impulse[slot] = 0.0
    soft.slot_friction_impulse[slot] = ti.Vector.zero(ti.f32, 3)


@ti.func
def _merge_contacts(soft: ti.template(), lost, kept):
    """End the contact in slot `lost` and add its impulses to the contact in slot `kept`."""
    soft.slot_gap[lost] = NO_CONTACT
    soft.slot_normal_impulse[kept] = soft.slot_normal_impulse[kept] + soft.slot_normal_impulse[lost]
    soft.slot_friction_impulse[kept] = soft.slot_friction_impulse[kept] + soft.slot_friction_impulse[lost]
    clear_impulses(soft, lost)


@ti.func
def _is_over(soft: ti.template(), slot):
    """1 if the nearest point of a contact is inside the triangle."""
    return int(soft.slot_weights[slot].yzw.max() < -OUTSIDE)


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
    is_inside = _is_over(soft, slot)
    for row in range(first, at):
        other = soft.near_slot[row]
        if soft.slot_gap[other] < NO_CONTACT:
            inside = is_inside + _is_over(soft, other)
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
    """1 if a vertex that is `depth` [m] behind a triangle is outside the triangle's body.

    Such a vertex is nearer to the front of another triangle of that body. This happens if a part of the body
    is thinner than the search range: the search then also returns the triangles on the far side of the part.
    Args:
        first, at: rows in `near_slot` of the vertex's first contact and of the contact in `slot`.
        behind: slot of the vertex's current contact from behind, or -1.
    """
    body, is_outside = state.particle_body[state.soft.slot_points[slot][1]], 0
    for row in range(first, at):
        other = state.soft.near_slot[row]
        if other != behind and state.soft.slot_gap[other] < depth:
            is_outside |= int(state.particle_body[state.soft.slot_points[other][1]] == body)
    return is_outside


@ti.func
def _store_contact(soft: ti.template(), slot, normal, weights):
    for i in ti.static(range(3)):
        soft.slot_normal[slot][i] = normal[i]
        soft.slot_weights[slot][1 + i] = -weights[i]
    soft.slot_weights[slot][0] = 1.0


@ti.func
def select_vertex_contacts(state: ti.template(), body, count, impact_speed, h):
    """Select contacts among the near candidates.

    A vertex in front of triangles has contact with all of them. A vertex behind triangles has contact only
    with the nearest of them. This contact is ignored if the vertex is nearer to the front of another triangle
    of the same body.

    Args:
        count: number of near candidates.
        impact_speed, h: see `list_near_candidates`.
    """
    first_slot = first_slot_of(state, body)
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
            p, other = state.soft.slot_points[slot][0], state.soft.slot_points[slot][1]
            if p != vertex:
                vertex, first_row, shallowest, behind = p, first + lane, -1e30, -1
            thickness, approach = contact_range(state, slot, False, impact_speed, h)
            state.soft.slot_gap[slot] = NO_CONTACT
            if feet[lane, 3] > 0.0 and distance <= thickness + approach:
                is_front = distance >= 0.0
                if ti.static(state.capacity.contact.rigid):
                    is_beside = ti.min(feet[lane, 0], feet[lane, 1], feet[lane, 2]) < 0.0
                    is_front = is_front or (is_beside and _are_rigid(state, p, other))
                if is_front:
                    _store_contact(state.soft, slot, normals[lane, :], feet[lane, :])
                    state.soft.slot_gap[slot] = distance - thickness
                    _merge_duplicate_contacts(state.soft, first_row, first + lane, MIN_ADVANTAGE * thickness)
                    if ti.static(state.capacity.contact.rigid):
                        _choose_face(state, state.soft, first_row, first + lane)
                    if behind >= 0 and distance < -shallowest:
                        before = state.soft.slot_points[behind][1]
                        if state.particle_body[before] == state.particle_body[other]:
                            state.soft.slot_gap[behind] = NO_CONTACT
                            shallowest, behind = -1e30, -1
                elif (
                    state.particle_body[other] != body
                    and distance > shallowest
                    and _is_in_front(state, first_row, first + lane, slot, -distance, behind) == 0
                ):
                    _store_contact(state.soft, slot, normals[lane, :], feet[lane, :])
                    if behind >= 0:
                        if state.soft.slot_normal[behind].dot(state.soft.slot_normal[slot]) > SAME_NORMAL:
                            _merge_contacts(state.soft, behind, slot)
                        state.soft.slot_gap[behind] = NO_CONTACT
                    state.soft.slot_gap[slot] = distance - thickness
                    shallowest, behind = distance, slot


@ti.func
def precompute_vertex_contact(state: ti.template(), slot):
    """Compute how friction is distributed between a vertex and the corners of a triangle.

    Friction acts at the vertex, as if the triangle extended to the vertex. The velocity of the triangle there
    is sum b v - s sum g (n.v), as in a rigid rotation. The symbols are the barycentric coordinates b of the
    vertex, their gradients g, the velocities v of the corners, the normal n of the triangle and the height s
    of the vertex above the triangle. Distributing the impulse in the same proportions conserves the angular
    momentum of the pair at any distance.
    """
    points, weights = state.soft.slot_points[slot], -state.soft.slot_weights[slot].yzw
    a, b, c = (
        state.particle_position[points[1]],
        state.particle_position[points[2]],
        state.particle_position[points[3]],
    )
    face = (b - a).cross(c - a)
    area2 = ti.max(face.norm(), 1e-30)
    n = face / area2
    separation = state.particle_position[points[0]] - weights.x * a - weights.y * b - weights.z * c
    height = separation.dot(n)
    gradients = ti.Matrix.rows([n.cross(c - b) / area2, n.cross(a - c) / area2, n.cross(b - a) / area2])
    shares = weights + gradients @ separation
    state.soft.slot_axis[slot] = n
    state.soft.slot_shares[slot] = ti.Vector([1.0, -shares.x, -shares.y, -shares.z])
    for i in ti.static(range(3)):
        state.soft.slot_levers[slot][0, i] = 0.0
        for k in ti.static(range(3)):
            state.soft.slot_levers[slot][1 + k, i] = -height * gradients[k, i]
