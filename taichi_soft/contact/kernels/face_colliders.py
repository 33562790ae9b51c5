"""Collide the faces of bodies with the edges, corners and thin parts of colliders, where no particle is.

Faces are the triangles of a surface and their edges, and the edges of ropes. Particles collide first: see
`collide`. Then each face near a collider is moved along the paths of its corners. If a point that is not a
corner touches the collider, a contact acts between this point and the collider. Its impulses and
displacements act on the corners by the point's barycentric coordinates. All contacts of a body are solved
together by projected Gauss-Seidel over velocities, as in `hull_colliders`. A change of velocity also changes
the path that remains after the touch. Remaining penetration is corrected by changing positions.

Macklin et al. (2020), "Local Optimization for Robust Signed Distance Field Collision", also search for the
deepest point of a triangle, by other methods. Planes need no faces: a particle is always deepest.

Groups of fields: reads hull; writes colliders, faces.
"""

from taichi_soft.bodies.kernels.origins import rounding_at
from taichi_soft.bodies.kernels.rigid import is_rigid, rigid_inv_mass
from taichi_soft.contact.distances.box import is_over_one_side, span_over_side
from taichi_soft.contact.distances.floor import RESTITUTION_SPEED
from taichi_soft.contact.distances.lowest_point import Vector8, probe
from taichi_soft.contact.distances.shape_kind import ShapeKind
from taichi_soft.contact.distances.sweep import NO_TOUCH
from taichi_soft.contact.distances.tips import tip_count, tip_distance, touch_of_tip
from taichi_soft.contact.distances.triangle_sweep import (
    HOLDING,
    corner_of,
    first_touch_of_triangle,
    is_behind,
    is_convex,
    thickness_of,
)
from taichi_soft.contact.face_fields import FACES, INSIDE, PARTS
from taichi_soft.contact.kernels.collider_frames import (
    center_of,
    has_triangles,
    in_frame,
    radius_of,
    skin_of,
    start_of,
)
from taichi_soft.contact.kernels.hull_points import (
    apply_point_impulse,
    inv_mass_at,
    mark_touched,
    motion_of,
    shared_mobility,
    shift_point,
)
from taichi_soft.contact.kernels.rebound import add_normal_impulse
from taichi_soft.core.math.quaternion import spun, turned, turned_back
from taichi_soft.core.runtime import ti

SWEEPS = 8
"""Largest number of sweeps over all contacts of a body. Forward and backward sweeps alternate."""

ACCURACY = 0.01
"""Sum of the changes of all impulses in a sweep, relative to their sum, at which the sweeps end."""

MAX_PASSES = 8
"""Largest number of searches for contacts in a substep. Fast bodies need more than one: a face that is
stopped at one point turns about this point, and can touch again on the rest of its path."""

CORNER = 0.999
"""Barycentric coordinate above which a point counts as a corner. Corners have collided as particles before,
so they are left out in the first pass."""

DEEP = 1e-3
"""Depth of a point [m] beyond which a face of a solid moves inwards, whichever side of the collider is
nearer."""

SETTLING = 0.1
"""Fraction of its distance from the surface that a point approaches in a substep. Other contacts raise it."""

RECOVERY_SPEED = 1.0
"""Speed at which a point deeper than `DEEP` moves out [m/s]. Faster corrections would add much energy."""

FLATTEST = 0.05
"""Length of the gradient of the distance below which it gives no direction. It is short where the collider
reaches through the face."""

SHORTEST_SPAN = 0.02
"""Part of a line that must be over the side of a box for contacts at both ends of this part."""


@ti.dataclass
class _Task:
    """Values that all contacts of a body with one collider share in a substep."""

    h: ti.f32  # [s]
    travelled: ti.f32  # path of the body since its near faces were listed [m]
    end: ti.i32  # end of the rows for contacts
    is_solid: ti.i32  # 1 if the triangles are oriented outwards
    is_alone: ti.i32  # 1 if all other colliders near the body are planes
    corner: ti.f32  # barycentric coordinate above which a point counts as a corner
    c: (
        ti.i32
    )  # the collider, the distance at which it is touched [m], and its pose at both ends of the substep
    skin: ti.f32
    centre: ti.math.vec3
    rotation: ti.math.vec4
    centre_after: ti.math.vec3
    rotation_after: ti.math.vec4


@ti.func
def _triangle(state: ti.template(), body, face):
    """Return the corners of the triangle of a face. An edge of a rope has its second end twice."""
    corners = ti.Vector.zero(ti.i32, 3)
    if has_triangles(state, body) == 1:
        corners = state.touching.triangle_vertices[face // PARTS]
    else:
        ends = state.edge_vertices[face // PARTS]
        corners = ti.Vector([ends[0], ends[1], ends[1]])
    return corners


@ti.func
def _face(state: ti.template(), body, face):
    """Return the corners of a face. An edge has its second end twice."""
    corners = _triangle(state, body, face)
    if face % PARTS == 1:
        corners = ti.Vector([corners[1], corners[2], corners[2]])
    elif face % PARTS == 2:
        corners = ti.Vector([corners[2], corners[0], corners[0]])
    elif face % PARTS == 0:
        corners = ti.Vector([corners[0], corners[1], corners[1]])
    return corners


@ti.func
def _lowest_first(colliders: ti.template(), points):
    """Reorder the corners of a face so that the one nearest to colliders at the last search comes first."""
    first, second = colliders.particle_clearance[points[0]], colliders.particle_clearance[points[1]]
    third = colliders.particle_clearance[points[2]]
    result = points
    if points[1] == points[2]:
        if second < first:
            result = ti.Vector([points[1], points[0], points[0]])
    elif second < first and second <= third:
        result = ti.Vector([points[1], points[2], points[0]])
    elif third < first:
        result = ti.Vector([points[2], points[0], points[1]])
    return result


@ti.func
def _is_over_one_side(state: ti.template(), body, c, x, y, z, reach, since, left):
    """Return 1 if a face is over one side of a box, and stays so for the rest of the step, else 0."""
    colliders, found = state.colliders, 0
    if colliders.kind[c] == ShapeKind.BOX:
        found = is_over_one_side(
            colliders.parameters[c],
            in_frame(state, body, c, x, since),
            in_frame(state, body, c, y, since),
            in_frame(state, body, c, z, since),
            reach + colliders.speed[c] * left,
        )
    return found


@ti.real_func
def list_near_faces(state: ti.template(), body: ti.i32, reach: ti.f32, since: ti.f32, left: ti.f32):
    """List the faces of a body within `reach` [m] of a collider that is not a plane.

    Args:
        since, left: time since the start of the step, and until the end of the step [s].
    """
    colliders, row = state.colliders, body * state.colliders.capacity.colliders
    outer, faces = state.touching.body_outer[body], state.body_edges[body]
    if has_triangles(state, body) == 1:
        faces = state.touching.body_triangles[body]
    room, found = FACES * (outer[1] - outer[0]), 0
    origin = state.body_origin[body]
    count, has_edges = colliders.near_count[body], 0
    for i in range(count):
        has_edges = has_edges | int(colliders.kind[colliders.near[row + i]] != ShapeKind.PLANE)
    if has_edges == 0:
        room = 0
    for number in range(faces[0], ti.select(room > 0, faces[1], faces[0])):
        points, parts = _triangle(state, body, PARTS * number), 1
        if has_triangles(state, body) == 1:
            parts = state.faces.own_parts[number]
        a, b = state.particle_position[points[0]], state.particle_position[points[1]]
        c = state.particle_position[points[2]]
        middle = (a + b + c) / 3.0
        size = ti.max((a - middle).norm(), (b - middle).norm(), (c - middle).norm())
        gap = colliders.particle_clearance[points[0]] - (a - middle).norm()
        gap = ti.max(gap, colliders.particle_clearance[points[1]] - (b - middle).norm())
        gap = ti.max(gap, colliders.particle_clearance[points[2]] - (c - middle).norm())
        radius = radius_of(state, body)
        near, clearance, tip_clearance = size + reach + radius + rounding_at(origin), reach, reach
        for i in range(ti.select(gap < near, count, 0)):
            k = colliders.near[row + i]
            low, high = colliders.lower[k] - origin - middle, colliders.upper[k] - origin - middle
            if colliders.kind[k] != ShapeKind.PLANE and low.max() <= near and high.min() >= -near:
                x, margin = in_frame(state, body, k, middle, since), size + colliders.speed[k] * left
                distance = probe(colliders, k, x, skin_of(state, body, k)).w - margin
                if (
                    distance < reach
                    and _is_over_one_side(state, body, k, a, b, c, reach + radius, since, left) == 0
                ):
                    clearance = ti.min(clearance, distance)
                    tip_clearance = ti.min(tip_clearance, tip_distance(colliders, k, x) - margin)
        tip_clearance = ti.max(tip_clearance, clearance)
        for part in range(PARTS):
            limit = ti.select(part == INSIDE, tip_clearance, clearance)
            if (parts >> part) & 1 == 1 and limit < reach and found < room:
                at = FACES * outer[0] + found
                state.faces.near_face[at], state.faces.clearance[at] = PARTS * number + part, limit
                state.faces.plane_collider[at] = -1
                found += 1
    state.faces.near_count[body] = found


@ti.func
def store_starts(state: ti.template(), body, h, travelled):
    """Store where the corners of faces that can touch began the substep. Call this after the drift."""
    first = FACES * state.touching.body_outer[body][0]
    for row in range(first, first + state.faces.near_count[body]):
        if not (state.faces.clearance[row] > travelled):
            points = _face(state, body, state.faces.near_face[row])
            for k in ti.static(range(3)):
                x, v = motion_of(state, points[k])
                state.faces.start[points[k]] = x - h * v


@ti.func
def _inv_mass(state: ti.template(), points, weights):
    """Return the inverse mass of a point of a face [1/kg]; 0 if it cannot move."""
    total = ti.cast(0.0, ti.f32)
    for i in ti.static(range(3)):
        total += weights[i] ** 2 * inv_mass_at(state, points[i])
        if ti.static(state.capacity.contact.hull):
            for k in ti.static(range(i)):
                total += 2.0 * weights[i] * weights[k] * shared_mobility(state, points[i], points[k])
    return total


@ti.func
def _motion(state: ti.template(), row):
    """Return position [m] and velocity [m/s] of the point in contact."""
    x, v = ti.Vector.zero(ti.f32, 3), ti.Vector.zero(ti.f32, 3)
    points, weights = state.faces.points[row], state.faces.weights[row]
    for k in ti.static(range(3)):
        own_x, own_v = motion_of(state, points[k])
        x += weights[k] * own_x
        v += weights[k] * own_v
    return x, v


@ti.func
def _normal_of(gradient, distance, inwards, is_line, is_solid):
    """Return the contact normal of a touch, or zero if it is unknown.

    Inside a triangle, it is normal to the triangle. Deep in a collider, solids are moved inwards.

    Args: inwards: normal of the triangle of the face, towards the inside of a solid; zero for ropes.
    """
    inwards /= ti.max(inwards.norm(), 1e-30)
    normal = gradient / ti.max(gradient.norm(), 1e-30)
    if is_solid == 1 and (gradient.norm() < FLATTEST or (distance < -DEEP and normal.dot(inwards) < 0.0)):
        normal = inwards
    elif is_line == 0:
        normal = ti.select(normal.dot(inwards) < 0.0, -inwards, inwards)
    elif gradient.norm() < FLATTEST:
        normal = 0.0 * inwards
    return normal


@ti.func
def _pose(state: ti.template(), body, c, time):
    """Return position [m] and rotation of a collider at a `time` [s] after the start of the step."""
    rotation = spun(state.colliders.rotation[c], state.colliders.spin[c] * time)
    return center_of(state, body, c, time), rotation


@ti.func
def _in_world(plane, centre, rotation):
    """Transform a plane from the frame of a collider to the world."""
    n = turned(rotation, plane.xyz)
    return ti.Vector([n.x, n.y, n.z, plane.w - n.dot(centre)])


@ti.func
def _is_clear(state: ti.template(), near, task, first: ti.template(), last: ti.template()):
    """Return 1 if the plane of the last search still separates a face from the collider, else 0.

    Args: first, last: corners at the start and at the end of the substep [m].
    """
    plane, is_clear = state.faces.plane[near], 0
    if state.faces.plane_collider[near] == task.c:
        is_clear = is_behind(_in_world(plane, task.centre, task.rotation), first)
        is_clear = is_clear & is_behind(_in_world(plane, task.centre_after, task.rotation_after), last)
    return is_clear


@ti.func
def _store_clearance(state: ti.template(), near, task, touch):
    """Store what a search without a touch found about a face: see `first_touch_of_triangle`."""
    if is_convex(state.colliders.kind[task.c]) == 1:
        state.faces.plane_collider[near] = task.c
        state.faces.plane[near] = ti.Vector([touch[1], touch[2], touch[3], touch[4]])
    elif task.is_alone == 1 and state.colliders.speed[task.c] == 0.0:
        state.faces.clearance[near] = task.travelled + touch[5]


@ti.func
def _ends_on_side(colliders: ti.template(), task, touch, start: ti.template(), end: ti.template()):
    """Return the touches at both ends of a line's part over a side of a box, if the line lies on this side.

    A point between them would not stop the line from turning about it. Otherwise, return the touch, and none.
    """
    c, first, second = task.c, touch, Vector8(NO_TOUCH)
    if touch[0] < NO_TOUCH and colliders.kind[c] == ShapeKind.BOX:
        here = start + touch[1] * (end - start)
        x, y = corner_of(here, 0), corner_of(here, 1)
        gradient = ti.Vector([touch[5], touch[6], touch[7]])
        at0, at1, height0, height1, normal = span_over_side(
            colliders.parameters[c], task.skin, x, y, gradient
        )
        if at1 - at0 > SHORTEST_SPAN and ti.max(height0, height1) <= HOLDING:
            along = (y - x) / ti.max((y - x).norm(), 1e-30)
            n = (normal - normal.dot(along) * along).normalized()
            first = Vector8(touch[0], touch[1], height0, 1.0 - at0, at0, n.x, n.y, n.z)
            second = Vector8(touch[0], touch[1], height1, 1.0 - at1, at1, n.x, n.y, n.z)
    return first, second


@ti.func
def _store_contact(
    state: ti.template(),
    body,
    row,
    near,
    points,
    task,
    touch,
    start: ti.template(),
    end: ti.template(),
    is_line,
):
    """Store the contact of a face at a touch. Returns: 1, or 0 if the point cannot move or has no normal."""
    c, is_stored = task.c, 0
    weights, distance = ti.Vector([touch[3], touch[4], 1.0 - touch[3] - touch[4]]), touch[2]
    corners = _triangle(state, body, state.faces.near_face[near])
    a, _ = motion_of(state, corners[0])
    b, _ = motion_of(state, corners[1])
    d, _ = motion_of(state, corners[2])
    inwards = turned_back(task.rotation_after, (d - a).cross(b - a))
    n = _normal_of(ti.Vector([touch[5], touch[6], touch[7]]), distance, inwards, is_line, task.is_solid)
    # Distance of the point from the tangent plane at the end of the path, if nothing stops it.
    beyond = ti.select(distance < -DEEP, -RECOVERY_SPEED * task.h, distance)
    beyond += (1.0 - touch[1]) * n.dot((end - start).transpose() @ weights)
    state.faces.points[row], state.faces.weights[row] = points, weights
    x, v = _motion(state, row)
    inv_mass, length2 = _inv_mass(state, points, weights), n.norm_sqr()
    n = turned(task.rotation_after, n)
    if ti.static(state.capacity.contact.rigid):
        if is_rigid(state, body):
            inv_mass = rigid_inv_mass(state, body, x, n)
    if inv_mass > 0.0 and length2 > 0.0 and (is_line == 0 or weights.max() <= task.corner):
        anchor, left = x - beyond * n, (1.0 - touch[0]) * task.h
        surface = state.colliders.velocity[c] + state.colliders.spin[c].cross(anchor - task.centre_after)
        approach = n.dot(surface - v)
        allowed = ti.cast(0.0, ti.f32)
        if approach > RESTITUTION_SPEED:
            allowed = ti.max(state.colliders.surface[c].y, 0.0) * approach
        elif left > 0.0:
            allowed = -SETTLING * ti.max(distance, 0.0) / left
        state.faces.collider[row], state.faces.normal[row] = c, n
        state.faces.surface[row], state.faces.anchor[row] = surface, anchor
        state.faces.time_left[row], state.faces.inv_mass[row] = left, inv_mass
        state.faces.allowed[row], state.faces.normal_impulse[row] = allowed, 0.0
        state.faces.friction_impulse[row] = ti.Vector.zero(ti.f32, 3)
        is_stored = 1
    return is_stored


@ti.func
def _record_contacts(state: ti.template(), body, row, near, points, task):
    """Store the contacts of a face with a collider from a `row` on.

    Args: near: row of the face among those near colliders.
    Returns: number of contacts; 1 if their path is long, so that the face can touch again, else 0.
    """
    c, count, is_long = task.c, 0, 0
    first, last = ti.Matrix.zero(ti.f32, 3, 3), ti.Matrix.zero(ti.f32, 3, 3)
    for k in ti.static(range(3)):
        x, _ = motion_of(state, points[k])
        before = state.faces.start[points[k]]
        for i in ti.static(range(3)):
            first[k, i], last[k, i] = before[i], x[i]
    if _is_clear(state, near, task, first, last) == 0:
        start, end = ti.Matrix.zero(ti.f32, 3, 3), ti.Matrix.zero(ti.f32, 3, 3)
        path = ti.cast(0.0, ti.f32)
        for k in ti.static(range(3)):
            before = turned_back(task.rotation, corner_of(first, k) - task.centre)
            x = turned_back(task.rotation_after, corner_of(last, k) - task.centre_after)
            path = ti.max(path, (x - before).norm())
            for i in ti.static(range(3)):
                start[k, i], end[k, i] = before[i], x[i]
        is_line = int(state.faces.near_face[near] % PARTS != INSIDE)
        is_short = int(path < thickness_of(state.colliders, c))
        tips = ti.select(is_line == 1, 0, tip_count(state.colliders.kind[c]))
        touch, second = Vector8(NO_TOUCH), Vector8(NO_TOUCH)
        if tips == 0:
            touch = first_touch_of_triangle(state.colliders, c, start, end, task.corner, is_line, task.skin)
            state.faces.plane_collider[near] = -1
            if touch[0] == NO_TOUCH:
                _store_clearance(state, near, task, touch)
            elif is_line == 1:
                touch, second = _ends_on_side(state.colliders, task, touch, start, end)
        for number in range(ti.max(tips, 2)):
            if tips > 0:
                touch = touch_of_tip(state.colliders, c, number, start, end, task.is_solid, is_short)
            elif number == 1:
                touch = second
            if touch[0] < NO_TOUCH and row + count < task.end:
                count += _store_contact(
                    state, body, row + count, near, points, task, touch, start, end, is_line
                )
        is_long = int(count > 0) & (1 - is_short)
    return count, is_long


@ti.func
def _react(state: ti.template(), body, row, x, v, impulse, shift, time):
    """Apply the reaction of a contact to its collider.

    Args:
        x: position of the point after the impulse and the displacement [m].
        v: velocity of the point before the impulse [m/s].
        impulse: impulse on the point [N s].
        shift: mass of the point times its displacement [kg m].
        time: time since the start of the step [s].
    """
    c = state.faces.collider[row]
    pair = body * state.colliders.capacity.colliders + c
    arm = x - start_of(state, body, c) - time * state.colliders.velocity[c]
    moment = arm.cross(impulse) + shift.cross(v)
    state.colliders.impulse[pair] = state.colliders.impulse[pair] - impulse
    state.colliders.angular_impulse[pair] = state.colliders.angular_impulse[pair] - moment


@ti.func
def _apply(state: ti.template(), row, impulse, shift):
    """Change velocities of a face's corners by an impulse on the point in contact, and positions by `shift`.

    Args: shift: mass of the point times its displacement [kg m].
    """
    points, weights = state.faces.points[row], state.faces.weights[row]
    for k in ti.static(range(3)):
        p, weight = points[k], weights[k]
        if weight > 0.0:
            if ti.static(state.capacity.contact.hull):
                apply_point_impulse(state, p, weight * impulse)
                shift_point(state, p, weight * shift)
            else:
                mobility = weight * state.particle_inv_mass[p]
                state.particle_velocity[p] = state.particle_velocity[p] + mobility * impulse
                state.particle_position[p] = state.particle_position[p] + mobility * shift


@ti.func
def _solve_contact(state: ti.template(), body, row, time):
    """Solve one contact for one sweep.

    Returns: size of the change of its impulse; its normal impulse [N s].
    """
    n, inv_mass = state.faces.normal[row], state.faces.inv_mass[row]
    x, v = _motion(state, row)
    relative = v - state.faces.surface[row]
    along = relative.dot(n)
    friction = state.colliders.surface[state.faces.collider[row]].x
    normal_impulse, friction_impulse = state.faces.normal_impulse[row], state.faces.friction_impulse[row]
    wanted = ti.max(normal_impulse + (state.faces.allowed[row] - along) / inv_mass, 0.0)
    wanted_friction = friction_impulse - (relative - along * n) / inv_mass
    wanted_friction *= ti.min(1.0, friction * wanted / ti.max(wanted_friction.norm(), 1e-30))
    state.faces.normal_impulse[row] = wanted
    state.faces.friction_impulse[row] = wanted_friction
    impulse = (wanted - normal_impulse) * n + wanted_friction - friction_impulse
    shift = state.faces.time_left[row] * impulse
    _apply(state, row, impulse, shift)
    _react(state, body, row, x + inv_mass * shift, v, impulse, shift, time)
    return ti.abs(impulse).sum(), wanted


@ti.func
def _finish_contact(state: ti.template(), body, row, time):
    """Correct the penetration of a contact, and record that it pressed."""
    n, c = state.faces.normal[row], state.faces.collider[row]
    x, v = _motion(state, row)
    depth = n.dot(state.faces.anchor[row] - x)
    if depth > 0.0:
        shift = depth / state.faces.inv_mass[row] * n
        nothing = ti.Vector.zero(ti.f32, 3)
        _apply(state, row, nothing, shift)
        _react(state, body, row, x, v, nothing, shift, time)
    normal_impulse = state.faces.normal_impulse[row]
    if normal_impulse > 0.0:
        points, weights = state.faces.points[row], state.faces.weights[row]
        for k in ti.static(range(3)):
            if weights[k] > 0.0:
                mark_touched(state, points[k])
        if state.colliders.surface[c].y >= 0.0:
            surface = n.dot(state.faces.surface[row])
            before = n.dot(v) - state.faces.inv_mass[row] * normal_impulse
            pair = body * state.colliders.capacity.colliders + c
            add_normal_impulse(state.colliders, pair, normal_impulse, n, before, surface)


@ti.real_func
def collide_faces(state: ti.template(), body: ti.i32, h: ti.f32, since: ti.f32, travelled: ti.f32):
    """Solve the contacts of a body's faces with colliders. Call this after the particles have collided.

    Args:
        since: time from the start of the step to the start of the substep [s].
        travelled: path of the body since its near faces were listed [m].
    """
    outer = state.touching.body_outer[body]
    first, room = FACES * outer[0], FACES * (outer[1] - outer[0])
    pairs = body * state.colliders.capacity.colliders
    is_solid = int(state.body_blocks[body][0] < state.body_blocks[body][1])
    others = 0
    for k in range(state.colliders.near_count[body]):
        others += int(state.colliders.kind[state.colliders.near[pairs + k]] != ShapeKind.PLANE)
    is_alone = int(others == 1)
    task = _Task(h=h, travelled=travelled, end=first + room, is_solid=is_solid, is_alone=is_alone)
    passes, is_open = 0, 1
    while is_open == 1:
        count, is_open = 0, 0
        task.corner = ti.select(passes == 0, CORNER, 2.0)
        for k in range(state.colliders.near_count[body]):
            task.c = state.colliders.near[pairs + k]
            if state.colliders.kind[task.c] != ShapeKind.PLANE:
                task.skin = skin_of(state, body, task.c)
                task.centre, task.rotation = _pose(state, body, task.c, since)
                task.centre_after, task.rotation_after = _pose(state, body, task.c, since + h)
                for i in range(state.faces.near_count[body]):
                    points = _face(state, body, state.faces.near_face[first + i])
                    is_clear = int(state.faces.clearance[first + i] > travelled)
                    if ti.static(state.capacity.implicit):
                        # The next solve holds the corner, and moves the rest of the face with it.
                        for corner in ti.static(range(3)):
                            is_clear = is_clear | int(state.particle_contact[points[corner]] > 0)
                    if is_clear == 0:
                        points = _lowest_first(state.colliders, points)
                        found, is_long = _record_contacts(state, body, first + count, first + i, points, task)
                        count += found
                        is_open = is_open | is_long
        sweep, change, total = 0, ti.cast(1.0, ti.f32), ti.cast(0.0, ti.f32)
        while sweep < SWEEPS and change > ACCURACY * total:
            change, total = 0.0, 0.0
            for i in range(count):
                row = first + ti.select(sweep % 2 == 0, i, count - 1 - i)
                changed, normal_impulse = _solve_contact(state, body, row, since + h)
                change, total = change + changed, total + normal_impulse
            sweep += 1
        for row in range(first, first + count):
            _finish_contact(state, body, row, since + h)
        passes += 1
        if passes == MAX_PASSES:
            is_open = 0
