"""Which candidates are contacts in a substep, and how their vertices lie to their triangles.

Those that may be reached within the substep are listed first, eight at a time, and their gaps are found side
by side, as the forces of tetrahedra in `elastic`. What then becomes of them goes vertex by vertex.
"""

from taichi_soft.contact.fields import NO_CONTACT, SLOTS
from taichi_soft.contact.kernels.contact_solver import note_levers
from taichi_soft.core.constants import LANES, ROW_BITS
from taichi_soft.core.math.finite import is_finite
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.math.triangle import closest_point_on_triangle
from taichi_soft.core.runtime import ti

OUTSIDE = 1e-4
"""Least barycentric weight at which the nearest point counts as inside the triangle."""

SAME = 0.7
"""Cosine between the directions of two contacts of a vertex from which they count as one: a flat surface is
met once, however it is cut into triangles; a corner twice."""

SAME_INSIDE = 0.95
"""The same for a vertex that is inside both triangles: it lies in a valley or a dent, or on two bodies. It is
held by both sides of a valley; in a dent, to hold it by more than one would make it swing."""

LEAD = 0.01
"""Part of the thickness by which a contact at an edge has to be nearer to follow one that bears."""


@ti.func
def _list_near(state: ti.template(), body, given, h):
    """List the candidates of a body that may touch within the substep. Returns how many they are.

    Args:
        given: speed that either may get from others [m/s].
        h: substep [s].
    """
    first_slot, slots, count = state.touching.body_outer[body][0] * SLOTS, state.soft.slot_count[body], 0
    for block in range((slots + LANES - 1) // LANES):
        first = (first_slot + block * LANES) & ROW_BITS
        is_near = ti.Vector.zero(ti.i32, LANES)
        for lane in range(LANES):
            who = state.soft.slot_vertices[first + lane]
            gone, speed = ti.cast(0.0, ti.f32), ti.cast(given, ti.f32)
            for i in ti.static(range(1, 4)):
                gone = ti.max(gone, state.soft.particle_gone[who[i]])
                speed = ti.max(speed, state.soft.particle_speed[who[i]])
            gone += state.soft.particle_gone[who[0]]
            way = h * (speed + ti.max(given, state.soft.particle_speed[who[0]]))
            is_near[lane] = ti.cast(state.soft.slot_spare[first + lane] < gone + way, ti.i32)
        for lane in range(ti.min(LANES, slots - block * LANES)):
            # Written in any case: to branch here would be guessed wrong too often.
            state.soft.near_slot[first_slot + count] = first + lane
            count += is_near[lane]
    return count


@ti.func
def _gap(state: ti.template(), slot):
    """How a vertex lies to a triangle.

    Returns: direction from the triangle; distance [m], negative behind it; weights of the nearest point;
    whether it may be in contact (1): what is behind an edge belongs to another triangle, or is outside.
    """
    who = state.soft.slot_vertices[slot]
    x = state.particle_position[who[0]]
    a, b, c = (
        state.particle_position[who[1]],
        state.particle_position[who[2]],
        state.particle_position[who[3]],
    )
    weights = closest_point_on_triangle(x, a, b, c)
    way = x - weights.x * a - weights.y * b - weights.z * c
    face = (b - a).cross(c - a)
    length = face.norm()
    face = face / ti.max(length, 1e-30)
    side, away = way.dot(face), way.norm()
    is_over = weights.min() > OUTSIDE
    distance = ti.select(is_over, side, away)
    normal = ti.select(is_over or side < 0.0 or away <= 1e-9, face, way / ti.max(away, 1e-30))
    can_touch = int(is_over or side >= 0.0) & int(length > 0.0) & is_finite(way) & is_finite(face)
    return normal, distance, weights, can_touch


@ti.func
def _reach_of(state: ti.template(), slot, given, h):
    """Thickness [m] at which a vertex and a triangle touch, and the way [m] that they may come nearer within
    the substep. Where one of their bodies explodes the way is -NO_CONTACT, and they never touch.
    """
    who = state.soft.slot_vertices[slot]
    mine, other = state.particle_body[who[0]], state.particle_body[who[1]]
    thickness = 0.5 * (state.soft.body_surface[mine].y + state.soft.body_surface[other].y)
    speed = ti.cast(given, ti.f32)
    for i in ti.static(range(1, 4)):
        speed = ti.max(speed, state.soft.particle_speed[who[i]])
    way = h * (speed + ti.max(given, state.soft.particle_speed[who[0]]))
    is_exploding = state.contact.is_exploding[mine] + state.contact.is_exploding[other]
    return thickness, ti.select(is_exploding > 0, -NO_CONTACT, way)


@ti.func
def _clear_impulses(soft: ti.template(), slot):
    soft.slot_normal_impulse[slot] = 0.0
    soft.slot_friction_impulse[slot] = ti.Vector.zero(ti.f32, 3)


@ti.func
def _give_way(soft: ti.template(), lost, kept):
    """One contact ends, and another goes on with its impulses."""
    soft.slot_gap[lost] = NO_CONTACT
    soft.slot_normal_impulse[kept] = soft.slot_normal_impulse[kept] + soft.slot_normal_impulse[lost]
    soft.slot_friction_impulse[kept] = soft.slot_friction_impulse[kept] + soft.slot_friction_impulse[lost]
    _clear_impulses(soft, lost)


@ti.func
def _drop_twins(soft: ti.template(), first, at, lead):
    """Of contacts that push a vertex the same way keep the nearest: this one, or one of those before.

    It goes on with the impulses of the other: a vertex that crosses an edge is borne there as well. In front
    of an edge both triangles are as near but for rounding, and the one that bears the vertex keeps it: as
    each shares out friction to other corners, every change is a jolt, and heaps would tremble for ever.

    Args:
        first, at: rows of `near_slot`, that of the vertex's first and of this one.
        lead: by which another has to be nearer at an edge [m].
    """
    slot = soft.near_slot[at]
    is_inside = int(soft.slot_weights[slot].min() > OUTSIDE)
    for row in range(first, at):
        other = soft.near_slot[row]
        if soft.slot_gap[other] < NO_CONTACT:
            inside = is_inside + int(soft.slot_weights[other].min() > OUTSIDE)
            same = ti.select(inside == 2, SAME_INSIDE, SAME)
            if soft.slot_normal[other].dot(soft.slot_normal[slot]) > same:
                bears = int(soft.slot_normal_impulse[other] > 0.0) - int(soft.slot_normal_impulse[slot] > 0.0)
                ahead = ti.select(inside == 0, bears * lead, 0.0)
                kept, lost = other, slot
                if soft.slot_gap[other] > soft.slot_gap[slot] + ahead:
                    kept, lost = slot, other
                _give_way(soft, lost, kept)


@ti.func
def _is_in_front(state: ti.template(), first, at, slot, depth, behind):
    """Whether a vertex that is `depth` [m] behind a triangle is nearer to the front of another of that body.

    Then it is outside: what is thinner than a search looks ahead shows its back as well.
    Args:
        first, at: rows of `near_slot`, that of the vertex's first and of this one.
        behind: slot of the contact that is behind so far, or -1.
    """
    body, is_outside = state.particle_body[state.soft.slot_vertices[slot][1]], 0
    for row in range(first, at):
        other = state.soft.near_slot[row]
        if other != behind and state.soft.slot_gap[other] < depth:
            is_outside |= int(state.particle_body[state.soft.slot_vertices[other][1]] == body)
    return is_outside


@ti.func
def _find_near_gaps(state: ti.template(), body, count, given, h):
    """Which of the near candidates count: those in front of their vertex's triangles, and of each vertex the
    one it is least deep behind, unless it is nearer to the front of the same body.

    Args:
        count: of the near ones.
        given, h: as in `_list_near`.
    """
    first_slot = state.touching.body_outer[body][0] * SLOTS
    vertex, first_row, shallowest, behind = -1, first_slot, ti.cast(-1e30, ti.f32), -1
    for block in range((count + LANES - 1) // LANES):
        first = (first_slot + block * LANES) & ROW_BITS
        normals = ti.Matrix.zero(ti.f32, LANES, 4)  # and the distance
        feet = ti.Matrix.zero(ti.f32, LANES, 4)  # weights of the nearest point, and whether it can touch
        for lane in range(LANES):
            normal, distance, weights, can_touch = _gap(state, state.soft.near_slot[first + lane])
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
            thickness, way = _reach_of(state, slot, given, h)
            state.soft.slot_gap[slot] = NO_CONTACT
            if feet[lane, 3] > 0.0 and distance <= thickness + way:
                if distance >= 0.0:
                    for i in ti.static(range(3)):
                        state.soft.slot_normal[slot][i] = normals[lane, i]
                        state.soft.slot_weights[slot][i] = feet[lane, i]
                    state.soft.slot_gap[slot] = distance - thickness
                    _drop_twins(state.soft, first_row, first + lane, LEAD * thickness)
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
                        if state.soft.slot_normal[behind].dot(state.soft.slot_normal[slot]) > SAME:
                            _give_way(state.soft, behind, slot)
                        state.soft.slot_gap[behind] = NO_CONTACT
                    state.soft.slot_gap[slot] = distance - thickness
                    shallowest, behind = distance, slot


@ti.real_func
def find_gaps(state: ti.template(), body: ti.i32, given: ti.f32, h: ti.f32):
    """List the contacts of a body's vertices; `given` and `h` as in `_list_near`."""
    first_slot, before = state.touching.body_outer[body][0] * SLOTS, state.soft.contact_count[body]
    near = _list_near(state, body, given, h)
    for k in range(first_slot, first_slot + before):
        state.soft.slot_gap[state.soft.contact_slot[k]] = NO_CONTACT
    _find_near_gaps(state, body, near, given, h)
    # None but the contacts may keep an impulse: it would begin the next one there, whenever that is.
    for k in range(first_slot, first_slot + before):
        slot = state.soft.contact_slot[k]
        if state.soft.slot_gap[slot] >= NO_CONTACT:
            _clear_impulses(state.soft, slot)
    count, near_row = 0, first_slot
    while near_row < first_slot + near:
        slot = state.soft.near_slot[near_row]
        if state.soft.slot_gap[slot] < NO_CONTACT:
            note_levers(state, slot)
            state.soft.contact_slot[first_slot + count] = slot
            count += 1
        else:
            _clear_impulses(state.soft, slot)  # a twin's, before one pushing elsewhere took its place
        near_row = row_behind(near_row)
    state.soft.contact_count[body] = count
