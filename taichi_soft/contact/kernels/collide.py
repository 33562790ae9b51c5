"""Collide the particles of one body with the colliders, in one thread.

Groups of fields: reads hull; writes colliders, faces.
"""

from taichi_soft.bodies.kernels.origins import rounding_at
from taichi_soft.contact.distances.distance import signed_distance
from taichi_soft.contact.distances.shape_kind import ShapeKind
from taichi_soft.contact.distances.sweep import NO_TOUCH, TOUCHING, distance_from, first_touch, rests_at
from taichi_soft.contact.fields import NO_COLLIDER
from taichi_soft.contact.kernels.collider_frames import center_of, in_frame, radius_of, skin_of
from taichi_soft.contact.kernels.rebound import add_normal_impulse
from taichi_soft.contact.kernels.restitution import resolved_velocity
from taichi_soft.core.math.quaternion import spun, turned, turned_back
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti

MAX_TOUCHES = 4
"""Largest number of successive touches of a particle with colliders in a substep. After the last one, the
particle stops."""


INNER_CHECK_PATH = 2.0
"""Path of a body's fastest particle in the rest of the step, in mean edges, above which inner particles are
checked too. In a hard impact, inner particles can move past outer particles that have stopped."""

UNCHECKED = 1e30
"""Clearance of particles that are not checked [m]."""


@ti.func
def set_travelled(state: ti.template(), body, travelled):
    """Store the distance [m] that a body has travelled since its near colliders were listed."""
    state.colliders.gone[body] = travelled


@ti.func
def react_on_collider(state: ti.template(), row, arm, impulse):
    """Apply the reaction of a particle's impulse to a collider.

    Args:
        row: row of the pair of body and collider.
        arm: vector from the collider's position to the particle [m].
        impulse: impulse on the particle [N s].
    """
    state.colliders.impulse[row] = state.colliders.impulse[row] - impulse
    state.colliders.angular_impulse[row] = state.colliders.angular_impulse[row] - arm.cross(impulse)


@ti.func
def with_conveyor(state: ti.template(), body, c, rotation, n, velocity):
    """Add the surface velocity of a conveyor to the velocity of a collider at a contact.

    Only the tangential part counts. A body on a conveyor does not fall asleep.
    Args:
        rotation: current rotation of the collider, a quaternion.
        n: normal of the surface.
        velocity: velocity at the contact by the motion of the collider [m/s].
    """
    found, along = velocity, state.colliders.surface_velocity[c]
    if along.dot(along) > 0.0:
        along = turned(rotation, along)
        found = velocity + along - n.dot(along) * n
        state.body_calm_time[body] = 0.0
    return found


@ti.func
def _measure_clearance(state: ti.template(), body, c, first, end, outer_only, since, left):
    """Limit the clearance of each particle by its distance from one collider.

    The distance that the collider can approach until the end of the step is subtracted.
    Args:
        first, end: range of rows in `outer_particle` if `outer_only` is 1; otherwise, range of particles.
        since, left: time since the start of the step, and until the end of the step [s].
    """
    colliders = state.colliders
    kind, parameters = colliders.kind[c], colliders.parameters[c]
    resolution, offset = colliders.resolution[c], colliders.offset[c]
    position = center_of(state, body, c, since)
    rotation = spun(colliders.rotation[c], colliders.spin[c] * since)
    margin = skin_of(state, body, c) + colliders.speed[c] * left
    # Fast path for planes, because most bodies are near no collider except the floor.
    plane = turned(rotation, ti.Vector([parameters[0], parameters[1], parameters[2]]))
    is_plane = kind == ShapeKind.PLANE
    for k in range(first, end):
        p = k
        if outer_only == 1:
            p = state.touching.outer_particle[k]
        beside = state.particle_position[p] - position
        distance = plane.dot(beside)
        if not is_plane:
            x = turned_back(rotation, beside)
            distance, _ = signed_distance(colliders.samples, kind, parameters, resolution, offset, x)
        colliders.particle_clearance[p] = ti.min(colliders.particle_clearance[p], distance - margin)


@ti.func
def _stays_clear(state: ti.template(), body, c, lower, upper, since, left):
    """True if a collider stays outside the box from `lower` to `upper` until the end of the step.

    The test compares the distance of the box's centre with half of the box's diagonal. It also works for
    planes, whose own boxes are infinite.
    """
    center, half_diagonal = 0.5 * (lower + upper), 0.5 * (upper - lower).norm()
    distance = distance_from(state.colliders, c, in_frame(state, body, c, center, since))
    return distance - skin_of(state, body, c) - state.colliders.speed[c] * left > half_diagonal


@ti.real_func
def find_near_colliders(state: ti.template(), body: ti.i32, reach: ti.f32, since: ti.f32, left: ti.f32):
    """List the colliders within `reach` [m] of a body's particles, and store each particle's clearance from
    them.

    Args:
        since, left: time since the start of the step, and until the end of the step [s].
    """
    outer, particles = state.touching.body_outer[body], state.body_particles[body]
    first = state.particle_position[state.touching.outer_particle[outer[0]]]
    lower, upper = first, first
    for k in range(outer[0], outer[1]):
        x = state.particle_position[state.touching.outer_particle[k]]
        lower, upper = ti.min(lower, x), ti.max(upper, x)
    is_deep = reach > INNER_CHECK_PATH * state.body_edge[body]
    if is_deep:
        for p in range(particles[0], particles[1]):
            x = state.particle_position[p]
            lower, upper = ti.min(lower, x), ti.max(upper, x)
    around = reach + radius_of(state, body)
    lower, upper = lower - around, upper + around
    row = body * state.colliders.capacity.colliders
    mine, origin = state.body_filter[body], state.body_origin[body]
    slack = rounding_at(origin)
    count = 0
    for c in range(state.colliders.count[None]):
        theirs = state.colliders.filter[c]
        wanted = (mine[0] & theirs[1]) != 0 and (theirs[0] & mine[1]) != 0
        if state.colliders.kind[c] != NO_COLLIDER and wanted:
            low = state.colliders.lower[c] - origin - slack
            high = state.colliders.upper[c] - origin + slack
            apart = 0
            for i in ti.static(range(3)):
                apart = apart | int(low[i] > upper[i]) | int(high[i] < lower[i])
            if apart == 0 and not _stays_clear(state, body, c, lower, upper, since, left):
                state.colliders.near[row + count] = c
                count += 1
    state.colliders.near_count[body] = count
    state.colliders.reach[body] = reach
    state.colliders.gone[body] = 0.0
    if count > 0:
        _measure_clearances(state, body, row, count, since, left, is_deep)


@ti.func
def _measure_clearances(state: ti.template(), body, row, count, since, left, is_deep):
    """Store the clearance of each particle from the `count` near colliders, which is 1 or more.

    All particles are checked against planes. Otherwise, inner particles of a folding body could move below
    the floor.
    """
    colliders, outer, particles = state.colliders, state.touching.body_outer[body], state.body_particles[body]
    for p in range(particles[0], particles[1]):
        colliders.particle_clearance[p] = UNCHECKED
    touches_by_points = False  # True if hull points collide instead of particles
    if ti.static(state.capacity.contact.hull):
        touches_by_points = state.hull.body_points[body][0] < state.hull.body_points[body][1]
    if is_deep and not touches_by_points:
        for i in range(count):
            if colliders.kind[colliders.near[row + i]] != ShapeKind.PLANE:
                near = colliders.near[row + i]
                _measure_clearance(state, body, near, particles[0], particles[1], 0, since, left)
        for p in range(particles[0], particles[1]):
            if colliders.particle_clearance[p] < 0.0:  # do not eject particles that entered unchecked
                colliders.particle_clearance[p] = UNCHECKED
    for k in range(outer[0], outer[1]):
        colliders.particle_clearance[state.touching.outer_particle[k]] = UNCHECKED
    for i in range(count):
        c = colliders.near[row + i]
        if colliders.kind[c] == ShapeKind.PLANE and not touches_by_points:
            _measure_clearance(state, body, c, particles[0], particles[1], 0, since, left)
        else:
            _measure_clearance(state, body, c, outer[0], outer[1], 1, since, left)


@ti.real_func
def clear_contacts(state: ti.template(), body: ti.i32):
    """Clear the impulses of the last step and the list of near colliders of a body."""
    row = body * state.colliders.capacity.colliders
    while row < (body + 1) * state.colliders.capacity.colliders:
        state.colliders.impulse[row] = ti.Vector.zero(ti.f32, 3)
        state.colliders.angular_impulse[row] = ti.Vector.zero(ti.f32, 3)
        state.colliders.normal_impulse[row] = ti.Vector.zero(ti.f32, 3)
        state.colliders.normal_impulse_rates[row] = ti.Vector.zero(ti.f32, 3)
        row = row_behind(row)
    state.colliders.near_count[body] = 0
    state.faces.near_count[body] = 0
    state.colliders.reach[body] = ti.select(state.colliders.count[None] == 0, 1e30, -1.0)
    state.colliders.gone[body] = 0.0


@ti.func
def collide_particle(state: ti.template(), body, p, h, since):
    """Collide a particle with the near colliders on its path in this substep.

    Call this after the drift has moved the particle along the path. A particle that touches nothing is not
    changed, so the result does not depend on which colliders are listed.
    Args:
        h: substep [s].
        since: time from the start of the fixed step to the start of the substep [s].
    """
    v = state.particle_velocity[p]
    path = h * v
    x = state.particle_position[p] - path
    row = body * state.colliders.capacity.colliders
    left = ti.cast(1.0, ti.f32)  # fraction of the substep that remains
    touches, is_open = 0, 1
    while is_open == 1:
        earliest, which = ti.cast(NO_TOUCH, ti.f32), -1
        distance, beyond, normal = ti.cast(0.0, ti.f32), ti.cast(0.0, ti.f32), ti.Vector.zero(ti.f32, 3)
        # After a touch, the path follows the surface up to rounding, which must not count as a second touch.
        slack = ti.select(touches == 0, 0.0, TOUCHING)
        for k in range(state.colliders.near_count[body]):
            c = state.colliders.near[row + k]
            a = in_frame(state, body, c, x, since + (1.0 - left) * h)
            b = in_frame(state, body, c, x + path, since + h)
            part, near, far, n = first_touch(state.colliders, c, a, b, slack, skin_of(state, body, c))
            if part < earliest:
                earliest, which, distance, beyond, normal = part, k, near, far, n
        if which < 0:
            is_open = 0
        else:
            c = state.colliders.near[row + which]
            after = since + h
            centre = center_of(state, body, c, after)
            spin = state.colliders.spin[c]
            rotation = spun(state.colliders.rotation[c], spin * after)
            n = turned(rotation, normal)
            place = x + path - beyond * n
            surface_velocity = state.colliders.velocity[c] + spin.cross(place - centre)
            surface_velocity = with_conveyor(state, body, c, rotation, n, surface_velocity)
            surface = state.colliders.surface[c]
            v_out = resolved_velocity(v, n, surface_velocity, surface.x, surface.y)
            change = v_out - v
            left = left * (1.0 - earliest)
            rest = ti.select(rests_at(distance), distance, 0.5 * TOUCHING)
            lift = ti.max(rest - distance, 0.0)
            before = x + path
            x += earliest * path + lift * n
            # Contact shortens the remaining path in the same proportion as it reduces the velocity.
            path = (
                (1.0 - earliest) * path + (rest - beyond - lift) * n + left * h * (change - n * change.dot(n))
            )
            touches += 1
            if state.colliders.near_count[body] == 1 and state.colliders.kind[c] == ShapeKind.PLANE:
                is_open = 0  # a path along a plane touches nothing else
            if touches == MAX_TOUCHES:
                path = ti.Vector.zero(ti.f32, 3)
                is_open = 0
            end = x + path
            mass = 1.0 / ti.max(state.particle_inv_mass[p], 1e-30)
            impulse = -mass * change
            if surface.y >= 0.0:
                add_normal_impulse(
                    state.colliders, row + c, -n.dot(impulse), n, n.dot(v), n.dot(surface_velocity)
                )
            # Shifting the end of the path changes the angular momentum even if v stays the same.
            angular_impulse = (end - centre).cross(impulse) - mass * (end - before).cross(v)
            state.colliders.impulse[row + c] = state.colliders.impulse[row + c] + impulse
            moment = state.colliders.angular_impulse[row + c] + angular_impulse
            state.colliders.angular_impulse[row + c] = moment
            state.particle_touches[p] = 1
            if ti.static(state.capacity.implicit):
                if state.particle_contact[p] == 0:
                    state.particle_contact[p] = c + 1
            v = v_out
    if touches > 0:
        state.particle_position[p] = x + path
        state.particle_velocity[p] = v
