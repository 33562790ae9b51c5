"""Bodies of an island against each other: impulses between a vertex and a triangle, pair by pair.

A pair that would come nearer than the thickness within the substep loses just so much of its approach, and
with it of its sliding: projected Gauss-Seidel over velocities, begun with the impulses of the substep before.
Impulses are equal and opposite. What is too near already is moved apart without giving it a velocity.
"""

from taichi_soft.bodies.kernels.particles import inv_mass_of, moves
from taichi_soft.contact.fields import SLOTS
from taichi_soft.contact.kernels.hull_solver import (
    mark_points,
    note_mobility,
    push_points_apart,
    solve_points,
)
from taichi_soft.core.math.finite import is_finite
from taichi_soft.core.runtime import ti

SWEEPS = 3
"""Times all pairs are gone through in a substep. As each begins with the impulses of the last one, eight make
heaps no calmer."""

PUSH_OUT = 0.2
"""Part of a penetration that one substep takes back."""

SLACK = 0.25
"""Part of the thickness that pairs may be too near without being moved apart. Contact ends within it; to move
at once what a sweep has left, step by step against what presses it together, feeds vibrations."""


@ti.func
def note_levers(state: ti.template(), slot):
    """What stays the same while a contact is solved again and again.

    Friction acts at the vertex, as if the triangle reached up to it. With b and g the vertex's barycentric
    coordinates and their gradients, n the triangle's normal and s the height above it, the triangle's
    velocity there is sum b v - s sum g (n.v): what a rigid turn gives. Taking the impulse up in the same
    proportions keeps the angular momentum of the two, whatever lies between them.
    """
    p, corners = state.soft.slot_vertices[slot].x, state.soft.slot_vertices[slot].yzw
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
    state.soft.slot_inv_mass[slot] = ti.Vector(
        [
            inv_mass_of(state, p),
            inv_mass_of(state, corners[0]),
            inv_mass_of(state, corners[1]),
            inv_mass_of(state, corners[2]),
        ]
    )
    state.soft.slot_moves[slot] = ti.Vector([moves(state, p), moves(state, corners[0])])
    if ti.static(state.capacity.contact.hull):
        note_mobility(state, slot, p, corners)


@ti.func
def _push_apart(state: ti.template(), p, corners, slot, depth):
    """Move apart what is too near by `depth` [m], by a part of it, without giving it a velocity."""
    normal, weights = state.soft.slot_normal[slot], state.soft.slot_weights[slot]
    total = inv_mass_of(state, p)
    for i in range(3):
        total += weights[i] * weights[i] * inv_mass_of(state, corners[i])
    if total > 0.0:
        push = PUSH_OUT * depth / total
        state.particle_position[p] = state.particle_position[p] + inv_mass_of(state, p) * push * normal
        for i in range(3):
            q = corners[i]
            back = weights[i] * inv_mass_of(state, q) * push
            state.particle_position[q] = state.particle_position[q] - back * normal


@ti.func
def _solve_contact(state: ti.template(), soft: ti.template(), slot, p, corners, friction, h, is_first):
    """Impulses between a vertex and a triangle: along the normal, so that no approach is left which would
    close the gap within `h` [s], and of friction. The first sweep repeats those of the last substep.

    Returns: whether the two are pressed together (1).
    """
    normal, weights, shares = soft.slot_normal[slot], soft.slot_weights[slot], soft.slot_shares[slot]
    face, levers, moves = soft.slot_face[slot], soft.slot_levers[slot], soft.slot_moves[slot]
    m, corner_m = soft.slot_inv_mass[slot][0], soft.slot_inv_mass[slot].yzw
    v = moves[0] * state.particle_velocity[p]
    corner_v = moves[1] * ti.Matrix.rows(
        [
            state.particle_velocity[corners[0]],
            state.particle_velocity[corners[1]],
            state.particle_velocity[corners[2]],
        ]
    )

    normal_impulse = soft.slot_normal_impulse[slot]
    push = normal_impulse
    if is_first == 0:
        allowed = -ti.max(soft.slot_gap[slot], 0.0) / h
        approach = v.dot(normal) - weights.dot(corner_v @ normal)
        total = m + (weights * weights).dot(corner_m)
        wanted_impulse = ti.max(normal_impulse + (allowed - approach) / ti.max(total, 1e-30), 0.0)
        push = wanted_impulse - normal_impulse
        normal_impulse = wanted_impulse
        soft.slot_normal_impulse[slot] = normal_impulse
    if is_finite(push * normal):
        v += m * push * normal
        corner_v -= (push * weights * corner_m).outer_product(normal)

    friction_impulse = soft.slot_friction_impulse[slot]
    # Where nothing presses any more, friction takes back what it gave in an earlier sweep.
    if normal_impulse > 0.0 or ti.abs(friction_impulse).max() > 0.0:
        change = friction_impulse
        if is_first == 0:
            relative = v - corner_v.transpose() @ shares + levers.transpose() @ (corner_v @ face)
            sliding = relative - relative.dot(normal) * normal
            tilt = levers @ (sliding / ti.max(sliding.norm(), 1e-30))
            total = m + corner_m.dot(shares * shares + tilt * tilt)
            wanted = friction_impulse - sliding / ti.max(total, 1e-30)
            wanted *= ti.min(1.0, friction * normal_impulse / ti.max(wanted.norm(), 1e-30))
            soft.slot_friction_impulse[slot] = wanted
            change = wanted - friction_impulse
        if is_finite(change):
            v += m * change
            taken = (corner_m * shares).outer_product(change)
            corner_v -= taken - (corner_m * (levers @ change)).outer_product(face)

    if moves[0] > 0.0:
        state.particle_velocity[p] = v
    if moves[1] > 0.0:
        for i in ti.static(range(3)):
            state.particle_velocity[corners[i]] = ti.Vector([corner_v[i, 0], corner_v[i, 1], corner_v[i, 2]])
    return int(normal_impulse > 0.0)


@ti.func
def _solve_slot(state: ti.template(), slot, h, sweep):
    """One contact in one sweep; the last one moves apart what is too near."""
    p, corners = state.soft.slot_vertices[slot].x, state.soft.slot_vertices[slot].yzw
    mine = state.soft.body_surface[state.particle_body[p]]
    theirs = state.soft.body_surface[state.particle_body[corners[0]]]
    if ti.static(state.capacity.contact.hull):
        friction = ti.sqrt(mine.x * theirs.x)
        if solve_points(state, state.soft, slot, p, corners, friction, h, int(sweep == 0)) == 1:
            mark_points(state, p, corners)
    elif (
        _solve_contact(state, state.soft, slot, p, corners, ti.sqrt(mine.x * theirs.x), h, int(sweep == 0))
        == 1
    ):
        state.contact.particle_touches[p] = 1
        for i in ti.static(range(3)):
            state.contact.particle_touches[corners[i]] = 1
    depth = -state.soft.slot_gap[slot] - SLACK * 0.5 * (mine.y + theirs.y)
    if sweep == SWEEPS and depth > 0.0:
        if ti.static(state.capacity.contact.hull):
            push_points_apart(state, p, corners, slot, PUSH_OUT * depth)
        else:
            _push_apart(state, p, corners, slot, depth)


@ti.real_func
def solve_island(state: ti.template(), island: ti.i32, h: ti.f32):
    """Take from the velocities of an island what would bring its bodies too near within `h` [s]."""
    first, last = state.contact.island_first[island], state.contact.island_first[island + 1]
    for sweep in range(SWEEPS + 1):
        for i in range(first, last):
            body = state.contact.island_body[i]
            row = state.touching.body_outer[body][0] * SLOTS
            for k in range(row, row + state.soft.contact_count[body]):
                _solve_slot(state, state.soft.contact_slot[k], h, sweep)
