"""Move bodies apart that were placed inside each other.

Contact keeps a vertex on its side of a surface, so bodies placed inside each other would stay inside. Each
step therefore begins with a search for bodies that overlap newly placed bodies. Contact ignores these pairs.
At the end of the step, the two bodies of a pair are moved apart as rigid bodies, at a limited speed. Their
velocities change only to stop an approach. As soon as the bodies no longer overlap, contact acts on them
again.

Groups of fields: reads colliders, hull, islands; writes soft.
"""

from taichi_soft.bodies.status import ACTIVE, CLEAR, JUST_PLACED, OVERLAPPING
from taichi_soft.contact.distances.distance import signed_distance
from taichi_soft.contact.fields import MAX_PARTNERS, NO_COLLIDER
from taichi_soft.contact.kernels.collider_frames import in_frame, skin_of
from taichi_soft.contact.kernels.feature_grid import boxes_overlap
from taichi_soft.contact.kernels.filters import may_touch
from taichi_soft.contact.kernels.hull_points import motion_of, place_points
from taichi_soft.contact.overlap import INSET
from taichi_soft.control.kernels.joints import are_joined
from taichi_soft.core.math.quaternion import spun, turned
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti

PARTING_RATE = 2.0
"""Relative speed at which two bodies are moved apart, divided by the largest side of the smaller body
[1/s]."""

OUTSET = 0.5
"""Smallest clearance, in thicknesses, at which contact acts on two bodies again. Contact then has hardly any
penetration to correct."""

INWARD_SHIFT = 0.05
"""Fraction by which the corners of a triangle are moved towards its centre for the overlap test."""

MIN_CENTER_DISTANCE = 1e-3
"""Distance of two centres, relative to the smaller body's largest side, below which the direction is computed
from the slots of the bodies."""


@ti.func
def _is_joined_or_filtered(state: ti.template(), a, b):
    """1 if two bodies are allowed to overlap, because they are joined or their groups exclude contact."""
    return int(not may_touch(state, a, b)) | are_joined(state, a, b)


@ti.func
def _mobility(state: ti.template(), body):
    """Return the inverse mass of a body [1/kg]; 0 if it is pinned or cannot move."""
    particles = state.body_particles[body]
    mass, is_free, p = ti.cast(0.0, ti.f32), int(state.body_status[body] == ACTIVE), particles[0]
    while p < particles[1]:
        mass += state.particle_mass[p]
        is_free = is_free & int(state.particle_inv_mass[p] > 0.0)
        p = row_behind(p)
    return is_free / ti.max(mass, 1e-30)


@ti.func
def _side_of_edge(p, q, a, b):
    """Return the side of an edge from `a` to `b` on which the origin of the plane lies: 1 or -1.

    The product is computed in the order of the particle numbers `p` and `q`, so that both triangles of the
    edge get the same product with opposite signs. A ray therefore passes through exactly one of the two
    triangles for any rounding.
    """
    is_turned = p > q
    first, second = ti.select(is_turned, b, a), ti.select(is_turned, a, b)
    side = ti.select(first.x * second.y - first.y * second.x >= 0.0, 1, -1)
    return ti.select(is_turned, -side, side)


@ti.real_func
def _encloses(state: ti.template(), body: ti.i32, x: ti.math.vec3) -> ti.i32:
    """1 if a point is inside the surface of a body: a ray from the point leaves the surface more often than
    it enters.
    """
    right, up = ti.Vector([0.8164966, -0.5773503, 0.0]), ti.Vector([0.4082483, 0.5773503, -0.7071068])
    triangles, leaves = state.touching.body_triangles[body], 0
    t = triangles[0]
    while t < triangles[1]:
        corners = state.touching.triangle_vertices[t]
        a = state.particle_position[corners[0]] - x
        b = state.particle_position[corners[1]] - x
        c = state.particle_position[corners[2]] - x
        # Projections along the direction of the ray.
        u = ti.Vector([right.dot(a), up.dot(a)])
        v = ti.Vector([right.dot(b), up.dot(b)])
        w = ti.Vector([right.dot(c), up.dot(c)])
        side = _side_of_edge(corners[0], corners[1], u, v)
        meets = side == _side_of_edge(corners[1], corners[2], v, w)
        meets = meets and side == _side_of_edge(corners[2], corners[0], w, u)
        if meets and side * a.dot(b.cross(c)) > 0.0:
            leaves += side
        t = row_behind(t)
    return int(leaves != 0)


@ti.real_func
def _reaches_into(state: ti.template(), body: ti.i32, other: ti.i32, depth: ti.f32) -> ti.i32:
    """1 if a point `depth` [m] below the surface of `body` (above if negative) is inside `other`.

    If `body` is a sheet or a rope, which has no inside, its outer particles are tested.
    """
    found = 0
    blocks, triangles = state.body_blocks[body], state.touching.body_triangles[body]
    lower, upper = state.body_bounds_lower[other], state.body_bounds_upper[other]
    if state.body_blocks[other][0] < state.body_blocks[other][1]:
        if blocks[0] < blocks[1]:
            t = triangles[0]
            while t < triangles[1] and found == 0:
                corners = state.touching.triangle_vertices[t]
                a = state.particle_position[corners[0]]
                b = state.particle_position[corners[1]]
                c = state.particle_position[corners[2]]
                across = (b - a).cross(c - a)
                middle = (a + b + c) / 3.0 - depth / ti.max(across.norm(), 1e-30) * across
                for i in range(4):
                    x = middle
                    if i < 3:
                        x += (1.0 - INWARD_SHIFT) * (state.particle_position[corners[i]] - (a + b + c) / 3.0)
                    if found == 0 and boxes_overlap(x, x, lower, upper):
                        found = _encloses(state, other, x)
                t = row_behind(t)
        else:
            outer = state.touching.body_outer[body]
            k = outer[0]
            while k < outer[1] and found == 0:
                x = state.particle_position[state.touching.outer_particle[k]]
                if boxes_overlap(x, x, lower, upper):
                    found = _encloses(state, other, x)
                k = row_behind(k)
    return found


@ti.func
def _overlap(state: ti.template(), a, b):
    """1 if two bodies overlap by more than `INSET`, or if they are being moved apart and are nearer than
    `OUTSET`.
    """
    depth = INSET * ti.min(state.body_surface[a].z, state.body_surface[b].z)
    if state.body_overlap[a] == OVERLAPPING or state.body_overlap[b] == OVERLAPPING:
        depth = -OUTSET * 0.5 * (state.body_surface[a].y + state.body_surface[b].y)
    found = _reaches_into(state, a, b, depth)
    if found == 0:
        found = _reaches_into(state, b, a, depth)
    return found


@ti.func
def _add_partner(soft: ti.template(), body, other):
    count = soft.partner_count[body]
    if count < MAX_PARTNERS:
        soft.partner[body * MAX_PARTNERS + count] = other
    soft.partner_count[body] = count + 1


@ti.real_func
def _find_partners(state: ti.template(), island: ti.i32, body: ti.i32):
    """Find the bodies that overlap `body`, which was just placed or is being moved apart from others."""
    mobility = _mobility(state, body)
    lower, upper = state.body_bounds_lower[body], state.body_bounds_upper[body]
    for i in range(state.islands.first[island], state.islands.first[island + 1]):
        other = state.islands.body[i]
        is_new = other > body or (other < body and state.body_overlap[other] == CLEAR)
        if is_new and _is_joined_or_filtered(state, body, other) == 0:
            their_lower, their_upper = state.body_bounds_lower[other], state.body_bounds_upper[other]
            if boxes_overlap(lower, upper, their_lower, their_upper):
                if mobility + _mobility(state, other) > 0.0 and _overlap(state, body, other) == 1:
                    _add_partner(state.soft, body, other)
                    _add_partner(state.soft, other, body)


@ti.real_func
def find_overlaps(state: ti.template(), island: ti.i32):
    """Find the overlapping bodies of an island. Call this before its step."""
    first, last = state.islands.first[island], state.islands.first[island + 1]
    placed, row = 0, first
    while row < last:
        body = state.islands.body[row]
        placed += int(state.body_overlap[body] != CLEAR)
        if state.soft.partner_count[body] != 0:
            state.soft.partner_count[body] = 0
        row = row_behind(row)
    if placed > 0:
        for i in range(first, last):
            place_points(state, state.islands.body[i])
        for i in range(first, last):
            if state.body_overlap[state.islands.body[i]] != CLEAR:
                _find_partners(state, island, state.islands.body[i])
        for i in range(first, last):
            body = state.islands.body[i]
            if state.body_overlap[body] != CLEAR:
                overlaps = state.soft.partner_count[body] > 0
                state.body_overlap[body] = ti.select(overlaps, OVERLAPPING, CLEAR)


@ti.func
def are_parting(state: ti.template(), body, other):
    """1 if contact ignores two bodies, because they overlap or because one overlaps too many bodies."""
    count = state.soft.partner_count[body]
    found = int(ti.max(count, state.soft.partner_count[other]) > MAX_PARTNERS)
    for k in range(ti.min(count, MAX_PARTNERS)):
        found |= int(state.soft.partner[body * MAX_PARTNERS + k] == other)
    return found


@ti.func
def _measure(state: ti.template(), body):
    """Store centre, displacement, velocity, largest side and mobility of a body, and reset its sums."""
    particles, outer = state.body_particles[body], state.body_outer[body]
    x0 = state.particle_position[particles[0]]
    mass = ti.cast(0.0, ti.f32)
    center, before = ti.Vector.zero(ti.f32, 3), ti.Vector.zero(ti.f32, 3)
    momentum = ti.Vector.zero(ti.f32, 3)
    for p in range(particles[0], particles[1]):
        m = state.particle_mass[p]
        mass += m
        center += m * (state.particle_position[p] - x0)
        before += m * (state.prev_position[p] - x0)
        momentum += m * state.particle_velocity[p]
    lower, upper = x0, x0
    for k in range(outer[0], outer[1]):
        x = state.particle_position[state.outer_particle[k]]
        lower, upper = ti.min(lower, x), ti.max(upper, x)
    state.soft.center[body] = x0 + center / mass
    state.soft.displacement[body] = (center - before) / mass
    state.soft.mean_velocity[body] = momentum / mass
    state.soft.size[body] = (upper - lower).max()
    state.soft.mobility[body] = _mobility(state, body)
    state.soft.parting_shift[body] = ti.Vector.zero(ti.f32, 3)
    state.soft.parting_kick[body] = ti.Vector.zero(ti.f32, 3)
    state.body_calm_time[body] = 0.0


@ti.func
def _point_of_slot(body):
    """Return a point of the unit square that is different for each slot, from Roberts' sequence R2."""
    u, v = 0.7548777 * body, 0.5698403 * body
    return ti.Vector([u - ti.floor(u), v - ti.floor(v), 0.0])


@ti.func
def _parting_direction(soft: ti.template(), a, b):
    """Return the direction from the centre of body `b` to the centre of body `a`.

    If the centres coincide, the direction is horizontal and depends on the slots of the bodies.
    """
    away = soft.center[a] - soft.center[b]
    if away.norm() < MIN_CENTER_DISTANCE * ti.min(soft.size[a], soft.size[b]):
        away = _point_of_slot(a) - _point_of_slot(b)
    return away / ti.max(away.norm(), 1e-30)


@ti.func
def _part_pair(soft: ti.template(), a, b, gravity, dt):
    """Compute the displacements and velocity changes that move two bodies apart, and add them to the sums of
    the bodies. Momentum is conserved.
    """
    n = _parting_direction(soft, a, b)
    mine, total = soft.mobility[a], soft.mobility[a] + soft.mobility[b]
    share = mine / total
    wanted = PARTING_RATE * ti.min(soft.size[a], soft.size[b]) * dt
    missing = ti.max(wanted - (soft.displacement[a] - soft.displacement[b]).dot(n), 0.0)
    # Move only the upper body against gravity, because the lower body can rest on a surface.
    up = -gravity / ti.max(gravity.norm(), 1e-30)
    rise = missing * n.dot(up)
    upper_share = share
    if mine > 0.0 and mine < total:
        upper_share = ti.select(rise > 0.0, 1.0, 0.0)
    level = missing * n - rise * up
    soft.parting_shift[a] = soft.parting_shift[a] + share * level + upper_share * rise * up
    soft.parting_shift[b] = soft.parting_shift[b] - (1.0 - share) * level - (1.0 - upper_share) * rise * up
    v = soft.mean_velocity[a] + soft.parting_kick[a] - soft.mean_velocity[b] - soft.parting_kick[b]
    kick = ti.max(-v.dot(n), 0.0)
    soft.parting_kick[a] = soft.parting_kick[a] + share * kick * n
    soft.parting_kick[b] = soft.parting_kick[b] - (1.0 - share) * kick * n


@ti.real_func
def _shift_beside_colliders(
    state: ti.template(), body: ti.i32, shift: ti.math.vec3, dt: ti.f32
) -> ti.math.vec3:
    """Return the displacement of a body [m], changed so that no particle moves deeper into a collider."""
    s = shift
    for c in range(state.colliders.count[None]):
        mine, theirs = state.body_filter[body], state.colliders.filter[c]
        touches = (mine[0] & theirs[1]) != 0 and (theirs[0] & mine[1]) != 0
        if touches and state.colliders.kind[c] != NO_COLLIDER:
            rotation = spun(state.colliders.rotation[c], state.colliders.spin[c] * dt)
            for k in range(state.touching.body_outer[body][0], state.touching.body_outer[body][1]):
                x, _ = motion_of(state, state.touching.outer_particle[k])
                before, _ = _distance(state, body, c, x, dt)
                after, normal = _distance(state, body, c, x + s, dt)
                s += ti.max(ti.min(before, 0.0) - after, 0.0) * turned(rotation, normal)
    return s


@ti.func
def _distance(state: ti.template(), body, c, x, time):
    """Return the distance of point `x` from a collider's skin [m], and the normal in the collider's frame."""
    distance, normal = signed_distance(
        state.colliders.samples,
        state.colliders.kind[c],
        state.colliders.parameters[c],
        state.colliders.resolution[c],
        state.colliders.offset[c],
        in_frame(state, body, c, x, time),
    )
    return distance - skin_of(state, body, c), normal


@ti.real_func
def _move_body(state: ti.template(), body: ti.i32, dt: ti.f32):
    count = state.soft.partner_count[body]
    if count > 0 and state.soft.mobility[body] > 0.0:
        wanted = state.soft.parting_shift[body] / ti.min(count, MAX_PARTNERS)
        shift = _shift_beside_colliders(state, body, wanted, dt)
        kick = state.soft.parting_kick[body]
        for p in range(state.body_particles[body][0], state.body_particles[body][1]):
            state.particle_position[p] = state.particle_position[p] + shift
            state.particle_velocity[p] = state.particle_velocity[p] + kick


@ti.real_func
def part_bodies(state: ti.template(), island: ti.i32, dt: ti.f32):
    """Move the overlapping bodies of an island apart, after its step of `dt` [s]."""
    first, last = state.islands.first[island], state.islands.first[island + 1]
    overlapping, row = 0, first
    while row < last:
        overlapping += state.soft.partner_count[state.islands.body[row]]
        row = row_behind(row)
    if overlapping > 0:
        for i in range(first, last):
            body = state.islands.body[i]
            if state.soft.partner_count[body] > 0:
                _measure(state, body)
        for i in range(first, last):
            body = state.islands.body[i]
            for k in range(ti.min(state.soft.partner_count[body], MAX_PARTNERS)):
                other = state.soft.partner[body * MAX_PARTNERS + k]
                if body < other:
                    _part_pair(state.soft, body, other, state.gravity[None], dt)
        for i in range(first, last):
            _move_body(state, state.islands.body[i], dt)


@ti.kernel
def mark_placed(state: ti.template(), body: ti.i32):
    """Make the next step check which bodies overlap `body`."""
    state.body_overlap[body] = JUST_PLACED
