"""Bodies of an island against each other: impulses between a vertex and a triangle, one pair after the other.

A pair that would come nearer than the thickness within the substep loses just so much of its approach
(Gauss-Seidel over velocities): impulses are equal and opposite, and never more than inelastic. What is too near
already is moved apart without giving it a velocity, a part in each substep.
"""

from taichi_soft.contact_fields import SLOTS
from taichi_soft.math.finite import is_finite
from taichi_soft.math.triangle import closest_point_on_triangle
from taichi_soft.runtime import ti
from taichi_soft.state import ACTIVE

PUSH_OUT = 0.2
"""Part of a penetration that one substep takes back."""

OUTSIDE = 1e-4
"""Least barycentric weight at which the nearest point counts as inside the triangle."""


@ti.func
def _mobility(state: ti.template(), p):
    """Inverse mass [1/kg]; zero where the body does not move."""
    free = state.body_status[state.particle_body[p]] == ACTIVE
    return state.particle_inv_mass[p] * ti.select(free, 1.0, 0.0)


@ti.func
def _gap(state: ti.template(), p, corners):
    """How a vertex lies to a triangle.

    Returns: distance [m], negative behind it; direction from the triangle; weights of the nearest point; whether
    it may be in contact (1): what is behind an edge belongs to another triangle, or is outside.
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
def _push_pair(state: ti.template(), p, corners, distance, normal, weights, thickness, friction, h):
    """Impulse and push between a vertex and a triangle."""
    w = _mobility(state, p)
    wa, wb, wc = _mobility(state, corners[0]), _mobility(state, corners[1]), _mobility(state, corners[2])
    total = w + weights.x * weights.x * wa + weights.y * weights.y * wb + weights.z * weights.z * wc
    relative = (
        state.particle_velocity[p]
        - weights.x * state.particle_velocity[corners[0]]
        - weights.y * state.particle_velocity[corners[1]]
        - weights.z * state.particle_velocity[corners[2]]
    )
    gap = distance - thickness
    approach = relative.dot(normal)
    allowed = -ti.max(gap, 0.0) / h
    if total > 0.0 and approach < allowed and is_finite(relative):
        press = (allowed - approach) / total
        sliding = relative - approach * normal
        slide = sliding.norm()
        rub = ti.min(friction * press, slide / total)
        impulse = press * normal - sliding * (rub / ti.max(slide, 1e-30))
        state.particle_velocity[p] = state.particle_velocity[p] + w * impulse
        state.particle_velocity[corners[0]] = state.particle_velocity[corners[0]] - weights.x * wa * impulse
        state.particle_velocity[corners[1]] = state.particle_velocity[corners[1]] - weights.y * wb * impulse
        state.particle_velocity[corners[2]] = state.particle_velocity[corners[2]] - weights.z * wc * impulse
    if total > 0.0 and gap < 0.0:
        push = normal * (-PUSH_OUT * gap / total)
        state.particle_position[p] = state.particle_position[p] + w * push
        state.particle_position[corners[0]] = state.particle_position[corners[0]] - weights.x * wa * push
        state.particle_position[corners[1]] = state.particle_position[corners[1]] - weights.y * wb * push
        state.particle_position[corners[2]] = state.particle_position[corners[2]] - weights.z * wc * push


@ti.func
def _solve_vertex(state: ti.template(), k, h):
    """One vertex against its candidates: those in front of it, and the one it is least deep behind."""
    p = state.outer_particle[k]
    mine = state.soft.body_surface[state.particle_body[p]]
    shallowest, slot_behind = ti.cast(-1e30, ti.f32), -1
    slot, last = k * SLOTS, k * SLOTS + state.soft.slot_count[k]
    is_second = 0
    while slot < last:
        corners = state.triangle_vertices[state.soft.slot_triangle[slot]]
        other = state.particle_body[corners[0]]
        distance, normal, weights, can_touch = _gap(state, p, corners)
        theirs = state.soft.body_surface[other]
        thickness = 0.5 * (mine.y + theirs.y)
        if can_touch == 1:
            if is_second == 1 or distance >= 0.0:
                friction = ti.sqrt(mine.x * theirs.x)
                _push_pair(state, p, corners, distance, normal, weights, thickness, friction, h)
            elif other != state.particle_body[p] and distance > shallowest:
                shallowest, slot_behind = distance, slot
        slot += 1
        if is_second == 1:
            slot = last
        elif slot == last and slot_behind >= 0:
            is_second, slot = 1, slot_behind


@ti.func
def solve_island(state: ti.template(), island, h):
    """Take from the velocities of an island what would bring its bodies too near within `h` [s]."""
    for i in range(state.contact.island_first[island], state.contact.island_first[island + 1]):
        outer = state.body_outer[state.contact.island_body[i]]
        for k in range(outer[0], outer[1]):
            if state.soft.slot_count[k] > 0:
                _solve_vertex(state, k, h)
