"""Kick of implicit Euler: constrain particles to colliders, solve for velocities, and apply impulses to the
colliders.

Groups of fields: reads colliders.
"""

from taichi_soft.bodies.kernels.particles import gravity_on
from taichi_soft.contact.distances.distance import signed_distance
from taichi_soft.contact.distances.sweep import TOUCHING
from taichi_soft.contact.fields import NO_COLLIDER
from taichi_soft.contact.kernels.collide import react_on_collider, with_conveyor
from taichi_soft.contact.kernels.collider_frames import skin_of, start_of
from taichi_soft.contact.kernels.rebound import add_normal_impulse
from taichi_soft.core.math.quaternion import spun, turned, turned_back
from taichi_soft.core.runtime import ti
from taichi_soft.solver.kernels.held_particles import constrain_particle, held_velocity
from taichi_soft.solver.kernels.implicit_solve import add_pin_reactions, record_residual, solve_body


@ti.func
def _surface_velocity(state: ti.template(), body, c, x, since, h):
    """Return the mean velocity of a collider's surface at `x` in a substep [m/s].

    For a rotating collider, the mean velocity points along the chord of the path. With a velocity along the
    tangent, particles on the collider would spiral outwards.

    The velocity of a conveyor is not included.

    Returns: the velocity, and the vector from the collider's position to `x` [m].
    """
    colliders = state.colliders
    arm = x - start_of(state, body, c) - since * colliders.velocity[c]
    turn = spun(ti.Vector([0.0, 0.0, 0.0, 1.0]), h * colliders.spin[c])
    return colliders.velocity[c] + (turned(turn, arm) - arm) / h, arm


@ti.func
def _surface_below(state: ti.template(), body, c, x, since):
    """Return the distance of `x` from a collider's thickened surface [m], and the surface normal at `x`.

    `since` is the time after the start of the step [s].
    """
    colliders = state.colliders
    rotation = spun(colliders.rotation[c], colliders.spin[c] * since)
    place = x - start_of(state, body, c) - since * colliders.velocity[c]
    kind, parameters = colliders.kind[c], colliders.parameters[c]
    resolution, offset = colliders.resolution[c], colliders.offset[c]
    distance, normal = signed_distance(
        colliders.samples, kind, parameters, resolution, offset, turned_back(rotation, place)
    )
    return distance - skin_of(state, body, c), turned(rotation, normal)


@ti.func
def _constrain_to_colliders(state: ti.template(), body, h, since):
    """Constrain the particles that lie on colliders, and release all other particles.

    A particle lies on a collider if gravity alone would return it to the collider within the substep.

    Returns: the number of constrained particles.
    """
    count, fall = 0, h * gravity_on(state, body).norm()
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        c = state.particle_contact[p] - 1
        state.particle_contact[p] = 0
        if c >= 0 and state.particle_inv_mass[p] > 0.0:
            mine, theirs = state.body_filter[body], state.colliders.filter[c]
            x, v = state.particle_position[p], state.particle_velocity[p]
            distance, n = _surface_below(state, body, c, x, since)
            surface_velocity, _ = _surface_velocity(state, body, c, x, since, h)
            leaving = n.dot(v - surface_velocity)
            is_near = distance + h * leaving <= TOUCHING + h * fall
            if state.colliders.kind[c] != NO_COLLIDER and (mine[0] & theirs[1]) != 0 and is_near:
                if (theirs[0] & mine[1]) != 0:
                    velocity_so_far, _ = _surface_velocity(state, body, c, x, since, -h)
                    rotation = spun(state.colliders.rotation[c], state.colliders.spin[c] * since)
                    velocity_so_far = with_conveyor(state, body, c, rotation, n, velocity_so_far)
                    surface_velocity = with_conveyor(state, body, c, rotation, n, surface_velocity)
                    state.particle_contact[p] = c + 1
                    approach = ti.max(distance - TOUCHING, 0.0) / h
                    constrain_particle(
                        state, p, n, v - velocity_so_far, surface_velocity - approach * n, fall
                    )
                    count += 1
    return count


@ti.func
def _apply_impulse(state: ti.template(), body, p, h, since):
    """Apply the impulse of a constrained particle to its collider.

    Returns: the velocity of the particle [m/s].
    """
    c, n = state.particle_contact[p] - 1, state.particle_hold[p].xyz
    velocity, pressing, across = held_velocity(state, p)
    surface_velocity, arm = _surface_velocity(state, body, c, state.particle_position[p], since, h)
    impulse = pressing * n + across
    row = body * state.colliders.capacity.colliders + c
    react_on_collider(state, row, arm, impulse)
    if pressing < 0.0:
        state.particle_contact[p] = 0
    else:
        state.particle_touches[p] = 1
        if state.colliders.surface[c].y >= 0.0:
            along = n.dot(surface_velocity)
            add_normal_impulse(state.colliders, row, pressing, n, along, along)
    return velocity


@ti.func
def kick_implicitly(state: ti.template(), program: ti.template(), body, h, since, is_first, common):
    """Solve for the new velocities of one body, and write its current positions to `direction`.

    Args:
        since: time since the start of the step [s].
        is_first: 1 in the first substep of a step.
    Returns: the highest speed of a particle, absolute and relative to the `common` velocity [m/s].
    """
    held_count = _constrain_to_colliders(state, body, h, since)
    record_residual(state, body, solve_body(state, program, body, h, held_count), is_first)
    highest, highest_beside = ti.cast(0.0, state.real), ti.cast(0.0, state.real)
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        v = state.particle_velocity[p]
        state.particle_touches[p] = 0
        if state.particle_inv_mass[p] == 0.0:
            state.solution[p] = state.particle_force[p].xyz - state.image[p]
        else:
            v += state.solution[p]
            if state.particle_contact[p] > 0:
                v = _apply_impulse(state, body, p, h, since)
        state.particle_velocity[p] = v
        state.direction[p] = state.particle_position[p]
        state.particle_force[p] = ti.Vector.zero(state.real, 4)
        highest = ti.max(highest, v.dot(v))
        if ti.static(program.has_soft_contact):
            state.particle_speed[p] = (v - common).norm()
            highest_beside = ti.max(highest_beside, (v - common).dot(v - common))
    add_pin_reactions(state, body, h)
    return ti.sqrt(highest), ti.sqrt(highest_beside)
