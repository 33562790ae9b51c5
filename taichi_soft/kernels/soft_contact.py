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
def mobility(state: ti.template(), p):
    """Inverse mass [1/kg]; zero where the body does not move."""
    free = state.body_status[state.particle_body[p]] == ACTIVE
    return state.particle_inv_mass[p] * ti.select(free, 1.0, 0.0)


@ti.func
def velocity(state: ti.template(), p):
    """[m/s]; zero where the body does not move: a frozen one keeps those that broke it."""
    moves = state.body_status[state.particle_body[p]] == ACTIVE
    return state.particle_velocity[p] * ti.select(moves, 1.0, 0.0)


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
def _find_gaps_of(state: ti.template(), k, gone, way):
    """Which candidates of a vertex count: those in front of it, and the one it is least deep behind.

    Args:
        gone: way [m] by which a pair may come nearer from the search to the end of this substep.
        way: the same within this substep.
    """
    p = state.outer_particle[k]
    mine = state.soft.body_surface[state.particle_body[p]]
    shallowest, behind = ti.cast(-1e30, ti.f32), -1
    for slot in range(k * SLOTS, k * SLOTS + state.soft.slot_count[k]):
        corners = state.triangle_vertices[state.soft.slot_triangle[slot]]
        other = state.particle_body[corners[0]]
        thickness = 0.5 * (mine.y + state.soft.body_surface[other].y)
        state.soft.slot_gap[slot] = NO_CONTACT
        if state.soft.slot_distance[slot] - gone < thickness:
            distance, normal, weights, can_touch = _gap(state, p, corners)
            state.soft.slot_normal[slot] = normal
            state.soft.slot_weights[slot] = weights
            is_wild = state.contact.is_wild[state.particle_body[p]] + state.contact.is_wild[other]
            if distance > thickness + way or is_wild > 0:
                can_touch = 0
            if can_touch == 1 and distance >= 0.0:
                state.soft.slot_gap[slot] = distance - thickness
                _drop_twins(state.soft, k * SLOTS, slot)
            elif can_touch == 1 and other != state.particle_body[p] and distance > shallowest:
                if behind >= 0:
                    state.soft.slot_gap[behind] = NO_CONTACT
                state.soft.slot_gap[slot] = distance - thickness
                shallowest, behind = distance, slot


@ti.func
def _press(state: ti.template(), p, corners, slot, h, is_first):
    """Impulse along the normal that leaves no approach which would close the gap within `h` [s]."""
    normal, weights = state.soft.slot_normal[slot], state.soft.slot_weights[slot]
    before = state.soft.slot_press[slot]
    total, approach = mobility(state, p), velocity(state, p).dot(normal)
    for i in range(3):
        total += weights[i] * weights[i] * mobility(state, corners[i])
        approach -= weights[i] * velocity(state, corners[i]).dot(normal)
    change = before
    if is_first == 0:
        allowed = -ti.max(state.soft.slot_gap[slot], 0.0) / h
        change = ti.max(before + (allowed - approach) / ti.max(total, 1e-30), 0.0) - before
        state.soft.slot_press[slot] = before + change
    if change != 0.0 and is_finite(change * normal):
        state.particle_velocity[p] = state.particle_velocity[p] + mobility(state, p) * change * normal
        for i in range(3):
            q = corners[i]
            pull = weights[i] * mobility(state, q) * change
            state.particle_velocity[q] = state.particle_velocity[q] - pull * normal


@ti.func
def _rub(state: ti.template(), p, corners, slot, friction, is_first):
    """Friction at the vertex, as if the triangle reached up to it.

    With b and g the vertex's barycentric coordinates and their gradients, n the triangle's normal and s the
    height above it, the triangle's velocity there is sum b v - s sum g (n.v): what a rigid turn gives. Taking
    the impulse up in the same proportions keeps the angular momentum of the two, whatever lies between them.
    """
    a, b, c = (
        state.particle_position[corners[0]],
        state.particle_position[corners[1]],
        state.particle_position[corners[2]],
    )
    normal, weights = state.soft.slot_normal[slot], state.soft.slot_weights[slot]
    face = (b - a).cross(c - a)
    area2 = ti.max(face.norm(), 1e-30)
    n = face / area2
    way = state.particle_position[p] - weights.x * a - weights.y * b - weights.z * c
    height = way.dot(n)
    gradients = ti.Matrix.rows([n.cross(c - b) / area2, n.cross(a - c) / area2, n.cross(b - a) / area2])
    shares = weights + gradients @ way
    before = state.soft.slot_rub[slot]
    change = before
    if is_first == 0:
        relative = velocity(state, p)
        for i in ti.static(range(3)):
            v = velocity(state, corners[i])
            gradient = ti.Vector([gradients[i, 0], gradients[i, 1], gradients[i, 2]])
            relative -= shares[i] * v - height * gradient * n.dot(v)
        sliding = relative - relative.dot(normal) * normal
        slide = sliding.norm()
        tilt = gradients @ (sliding / ti.max(slide, 1e-30))
        total = mobility(state, p)
        for i in ti.static(range(3)):
            total += mobility(state, corners[i]) * (
                shares[i] * shares[i] + height * height * tilt[i] * tilt[i]
            )
        wanted = before - sliding / ti.max(total, 1e-30)
        most = friction * state.soft.slot_press[slot]
        wanted = wanted * ti.min(1.0, most / ti.max(wanted.norm(), 1e-30))
        change = wanted - before
        state.soft.slot_rub[slot] = wanted
    if is_finite(change):
        state.particle_velocity[p] = state.particle_velocity[p] + mobility(state, p) * change
        tilt = gradients @ change
        for i in ti.static(range(3)):
            q = corners[i]
            impulse = shares[i] * change - height * tilt[i] * n
            state.particle_velocity[q] = state.particle_velocity[q] - mobility(state, q) * impulse


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
def _solve_vertex(state: ti.template(), k, h, sweep):
    """One vertex against its candidates. The first sweep repeats the last substep's impulses.

    Returns: the way [m] by which the last one moved a pair apart, at most.
    """
    p, farthest = state.outer_particle[k], ti.cast(0.0, ti.f32)
    mine = state.soft.body_surface[state.particle_body[p]]
    for slot in range(k * SLOTS, k * SLOTS + state.soft.slot_count[k]):
        if state.soft.slot_gap[slot] < NO_CONTACT:
            corners = state.triangle_vertices[state.soft.slot_triangle[slot]]
            theirs = state.soft.body_surface[state.particle_body[corners[0]]]
            _press(state, p, corners, slot, h, int(sweep == 0))
            is_pressed = state.soft.slot_press[slot] > 0.0
            # Where no press is left, friction takes back what it gave in an earlier sweep.
            if is_pressed or ti.abs(state.soft.slot_rub[slot]).max() > 0.0:
                _rub(state, p, corners, slot, ti.sqrt(mine.x * theirs.x), int(sweep == 0))
            if is_pressed:
                state.contact.particle_touches[p] = 1
                for i in ti.static(range(3)):
                    state.contact.particle_touches[corners[i]] = 1
            depth = -state.soft.slot_gap[slot] - SLACK * 0.5 * (mine.y + theirs.y)
            if sweep == SWEEPS and depth > 0.0:
                _push_apart(state, p, corners, slot, depth)
                farthest = ti.max(farthest, PUSH_OUT * depth)
        else:
            state.soft.slot_press[slot] = 0.0
            state.soft.slot_rub[slot] = ti.Vector.zero(ti.f32, 3)
    return farthest


@ti.func
def find_gaps(state: ti.template(), body, gone, way):
    """Which candidates of a body's vertices count; `gone` and `way` as in `_find_gaps_of`."""
    outer = state.body_outer[body]
    for k in range(outer[0], outer[1]):
        _find_gaps_of(state, k, gone, way)


@ti.func
def solve_island(state: ti.template(), island, h):
    """Take from the velocities of an island what would bring its bodies too near within `h` [s].

    Returns: the way [m] by which a pair was moved apart, at most.
    """
    farthest = ti.cast(0.0, ti.f32)
    first, last = state.contact.island_first[island], state.contact.island_first[island + 1]
    for sweep in range(SWEEPS + 1):
        for i in range(first, last):
            outer = state.body_outer[state.contact.island_body[i]]
            for k in range(outer[0], outer[1]):
                if state.soft.slot_count[k] > 0:
                    farthest = ti.max(farthest, _solve_vertex(state, k, h, sweep))
    return farthest
