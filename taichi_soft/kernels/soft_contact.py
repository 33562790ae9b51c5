"""Bodies of an island against each other: impulses between a vertex and a triangle, pair by pair.

A pair that would come nearer than the thickness within the substep loses just so much of its approach, and
with it of its sliding: projected Gauss-Seidel over velocities, begun with the impulses of the substep before.
Impulses are equal and opposite. What is too near already is moved apart without giving it a velocity.
"""

from taichi_soft.contact_fields import NO_CONTACT, SLOTS
from taichi_soft.math.finite import is_finite
from taichi_soft.math.triangle import closest_point_on_triangle
from taichi_soft.runtime import ti
from taichi_soft.state import ACTIVE

SWEEPS = 3
"""Times all pairs are gone through in a substep. As each begins with the impulses of the last one, eight make
heaps no calmer."""

PUSH_OUT = 0.2
"""Part of a penetration that one substep takes back."""

SLACK = 0.25
"""Part of the thickness that pairs may be too near without being moved apart. Contact ends within it; to move
at once what a sweep has left, step by step against what presses it together, feeds vibrations."""

OUTSIDE = 1e-4
"""Least barycentric weight at which the nearest point counts as inside the triangle."""

SAME = 0.7
"""Cosine between the directions of two contacts of a vertex from which they count as one: a flat surface is
met once, however it is cut into triangles; a corner twice."""


@ti.func
def _moves(state: ti.template(), p):
    """1 where the body of a particle moves, or 0."""
    return ti.select(state.body_status[state.particle_body[p]] == ACTIVE, 1.0, 0.0)


@ti.func
def mobility(state: ti.template(), p):
    """Inverse mass [1/kg]; zero where the body does not move."""
    return state.particle_inv_mass[p] * _moves(state, p)


@ti.func
def velocity(state: ti.template(), p):
    """[m/s]; zero where the body does not move: a frozen one keeps those that broke it."""
    return state.particle_velocity[p] * _moves(state, p)


@ti.func
def _gap(state: ti.template(), p, corners):
    """How a vertex lies to a triangle.

    Returns: distance [m], negative behind it; direction from the triangle; weights of the nearest point;
    whether it may be in contact (1): what is behind an edge belongs to another triangle, or is outside.
    """
    a, b, c = (
        state.particle_position[corners[0]],
        state.particle_position[corners[1]],
        state.particle_position[corners[2]],
    )
    x = state.particle_position[p]
    weights = closest_point_on_triangle(x, a, b, c)
    way = x - weights.x * a - weights.y * b - weights.z * c
    face = (b - a).cross(c - a)
    length = face.norm()
    face = face / ti.max(length, 1e-30)
    side = way.dot(face)
    distance = way.norm()
    normal = face
    can_touch = int(length > 0.0) & int(is_finite(x)) & int(is_finite(way)) & int(is_finite(face))
    if weights.min() > OUTSIDE:
        distance = side
    elif side < 0.0:
        can_touch = 0
    elif distance > 1e-9:
        normal = way / distance
    return distance, normal, weights, can_touch


@ti.func
def _drop_twins(soft: ti.template(), first, slot):
    """Of contacts that push a vertex the same way keep the nearest: this one, or one of those before.

    It goes on with the impulses of the other: a vertex that crosses an edge is borne there as well.
    """
    for other in range(first, slot):
        if soft.slot_gap[other] < NO_CONTACT:
            if soft.slot_normal[other].dot(soft.slot_normal[slot]) > SAME:
                kept, lost = other, slot
                if soft.slot_gap[other] > soft.slot_gap[slot]:
                    kept, lost = slot, other
                soft.slot_gap[lost] = NO_CONTACT
                soft.slot_press[kept] = soft.slot_press[kept] + soft.slot_press[lost]
                soft.slot_rub[kept] = soft.slot_rub[kept] + soft.slot_rub[lost]
                soft.slot_press[lost] = 0.0
                soft.slot_rub[lost] = ti.Vector.zero(ti.f32, 3)


@ti.func
def _find_gaps_of(state: ti.template(), p, first, last, given, h):
    """Which candidates of a vertex count: those in front of it, and the one it is least deep behind.

    Args:
        first, last: the slots of the vertex, which is particle `p`.
        given: speed that either may get from others [m/s].
        h: substep [s].
    """
    mine = state.soft.body_surface[state.particle_body[p]]
    shallowest, behind = ti.cast(-1e30, ti.f32), -1
    for slot in range(first, last):
        corners = state.triangle_vertices[state.soft.slot_triangle[slot]]
        other = state.particle_body[corners[0]]
        thickness = 0.5 * (mine.y + state.soft.body_surface[other].y)
        state.soft.slot_gap[slot] = NO_CONTACT
        gone, speed = ti.cast(0.0, ti.f32), ti.cast(given, ti.f32)
        for i in ti.static(range(3)):
            gone = ti.max(gone, state.soft.particle_gone[corners[i]])
            speed = ti.max(speed, state.soft.particle_speed[corners[i]])
        gone += state.soft.particle_gone[p]
        way = h * (speed + ti.max(given, state.soft.particle_speed[p]))
        if state.soft.slot_distance[slot] - gone - way < thickness:
            distance, normal, weights, can_touch = _gap(state, p, corners)
            state.soft.slot_normal[slot] = normal
            state.soft.slot_weights[slot] = weights
            is_wild = state.contact.is_wild[state.particle_body[p]] + state.contact.is_wild[other]
            if distance > thickness + way or is_wild > 0:
                can_touch = 0
            if can_touch == 1 and distance >= 0.0:
                state.soft.slot_gap[slot] = distance - thickness
                _drop_twins(state.soft, first, slot)
            elif can_touch == 1 and other != state.particle_body[p] and distance > shallowest:
                if behind >= 0:
                    state.soft.slot_gap[behind] = NO_CONTACT
                state.soft.slot_gap[slot] = distance - thickness
                shallowest, behind = distance, slot


@ti.func
def _note_levers(state: ti.template(), p, slot):
    """What stays the same while a contact is solved again and again.

    Friction acts at the vertex, as if the triangle reached up to it. With b and g the vertex's barycentric
    coordinates and their gradients, n the triangle's normal and s the height above it, the triangle's
    velocity there is sum b v - s sum g (n.v): what a rigid turn gives. Taking the impulse up in the same
    proportions keeps the angular momentum of the two, whatever lies between them.
    """
    corners = state.triangle_vertices[state.soft.slot_triangle[slot]]
    a, b, c = (
        state.particle_position[corners[0]],
        state.particle_position[corners[1]],
        state.particle_position[corners[2]],
    )
    weights = state.soft.slot_weights[slot]
    face = (b - a).cross(c - a)
    area2 = ti.max(face.norm(), 1e-30)
    n = face / area2
    way = state.particle_position[p] - weights.x * a - weights.y * b - weights.z * c
    gradients = ti.Matrix.rows([n.cross(c - b) / area2, n.cross(a - c) / area2, n.cross(b - a) / area2])
    state.soft.slot_face[slot] = n
    state.soft.slot_shares[slot] = weights + gradients @ way
    state.soft.slot_levers[slot] = way.dot(n) * gradients
    state.soft.slot_mobility[slot] = ti.Vector(
        [
            mobility(state, p),
            mobility(state, corners[0]),
            mobility(state, corners[1]),
            mobility(state, corners[2]),
        ]
    )
    state.soft.slot_moves[slot] = ti.Vector([_moves(state, p), _moves(state, corners[0])])


@ti.func
def find_gaps(state: ti.template(), body, given, h):
    """List the contacts of a body's vertices; `given` and `h` as in `_find_gaps_of`."""
    first_slot, count = state.body_outer[body][0] * SLOTS, 0
    last_slot = first_slot + state.soft.slot_count[body]
    first = first_slot
    while first < last_slot:
        p, last = state.soft.slot_particle[first], first + 1
        while last < last_slot and state.soft.slot_particle[last] == p:
            last += 1
        _find_gaps_of(state, p, first, last, given, h)
        for slot in range(first, last):
            if state.soft.slot_gap[slot] < NO_CONTACT:
                _note_levers(state, p, slot)
                state.soft.contact_slot[first_slot + count] = slot
                count += 1
            else:
                state.soft.slot_press[slot] = 0.0
                state.soft.slot_rub[slot] = ti.Vector.zero(ti.f32, 3)
        first = last
    state.soft.contact_count[body] = count


@ti.func
def _push_apart(state: ti.template(), p, corners, slot, depth):
    """Move apart what is too near by `depth` [m], by a part of it, without giving it a velocity."""
    normal, weights = state.soft.slot_normal[slot], state.soft.slot_weights[slot]
    total = mobility(state, p)
    for i in range(3):
        total += weights[i] * weights[i] * mobility(state, corners[i])
    if total > 0.0:
        push = PUSH_OUT * depth / total
        state.particle_position[p] = state.particle_position[p] + mobility(state, p) * push * normal
        for i in range(3):
            q = corners[i]
            back = weights[i] * mobility(state, q) * push
            state.particle_position[q] = state.particle_position[q] - back * normal


@ti.func
def _solve_contact(state: ti.template(), soft: ti.template(), slot, p, corners, friction, h, is_first):
    """Impulses between a vertex and a triangle: along the normal, so that no approach is left which would
    close the gap within `h` [s], and of friction. The first sweep repeats those of the last substep.

    Returns: whether the two are pressed together (1).
    """
    normal, weights, shares = soft.slot_normal[slot], soft.slot_weights[slot], soft.slot_shares[slot]
    face, levers, moves = soft.slot_face[slot], soft.slot_levers[slot], soft.slot_moves[slot]
    m, corner_m = soft.slot_mobility[slot][0], soft.slot_mobility[slot].yzw
    v = moves[0] * state.particle_velocity[p]
    corner_v = moves[1] * ti.Matrix.rows(
        [
            state.particle_velocity[corners[0]],
            state.particle_velocity[corners[1]],
            state.particle_velocity[corners[2]],
        ]
    )

    press = soft.slot_press[slot]
    push = press
    if is_first == 0:
        allowed = -ti.max(soft.slot_gap[slot], 0.0) / h
        approach = v.dot(normal) - weights.dot(corner_v @ normal)
        total = m + (weights * weights).dot(corner_m)
        wanted_press = ti.max(press + (allowed - approach) / ti.max(total, 1e-30), 0.0)
        push = wanted_press - press
        press = wanted_press
        soft.slot_press[slot] = press
    if is_finite(push * normal):
        v += m * push * normal
        corner_v -= (push * weights * corner_m).outer_product(normal)

    rub = soft.slot_rub[slot]
    # Where no press is left, friction takes back what it gave in an earlier sweep.
    if press > 0.0 or ti.abs(rub).max() > 0.0:
        change = rub
        if is_first == 0:
            relative = v - corner_v.transpose() @ shares + levers.transpose() @ (corner_v @ face)
            sliding = relative - relative.dot(normal) * normal
            tilt = levers @ (sliding / ti.max(sliding.norm(), 1e-30))
            total = m + corner_m.dot(shares * shares + tilt * tilt)
            wanted = rub - sliding / ti.max(total, 1e-30)
            wanted *= ti.min(1.0, friction * press / ti.max(wanted.norm(), 1e-30))
            soft.slot_rub[slot] = wanted
            change = wanted - rub
        if is_finite(change):
            v += m * change
            taken = (corner_m * shares).outer_product(change)
            corner_v -= taken - (corner_m * (levers @ change)).outer_product(face)

    if moves[0] > 0.0:
        state.particle_velocity[p] = v
    if moves[1] > 0.0:
        for i in ti.static(range(3)):
            state.particle_velocity[corners[i]] = ti.Vector([corner_v[i, 0], corner_v[i, 1], corner_v[i, 2]])
    return int(press > 0.0)


@ti.func
def _solve_slot(state: ti.template(), slot, h, sweep):
    """One contact in one sweep; the last one moves apart what is too near."""
    p, corners = state.soft.slot_particle[slot], state.triangle_vertices[state.soft.slot_triangle[slot]]
    mine = state.soft.body_surface[state.particle_body[p]]
    theirs = state.soft.body_surface[state.particle_body[corners[0]]]
    if (
        _solve_contact(state, state.soft, slot, p, corners, ti.sqrt(mine.x * theirs.x), h, int(sweep == 0))
        == 1
    ):
        state.contact.particle_touches[p] = 1
        for i in ti.static(range(3)):
            state.contact.particle_touches[corners[i]] = 1
    depth = -state.soft.slot_gap[slot] - SLACK * 0.5 * (mine.y + theirs.y)
    if sweep == SWEEPS and depth > 0.0:
        _push_apart(state, p, corners, slot, depth)


@ti.func
def solve_island(state: ti.template(), island, h):
    """Take from the velocities of an island what would bring its bodies too near within `h` [s]."""
    first, last = state.contact.island_first[island], state.contact.island_first[island + 1]
    for sweep in range(SWEEPS + 1):
        for i in range(first, last):
            body = state.contact.island_body[i]
            row = state.body_outer[body][0] * SLOTS
            for k in range(row, row + state.soft.contact_count[body]):
                _solve_slot(state, state.soft.contact_slot[k], h, sweep)
