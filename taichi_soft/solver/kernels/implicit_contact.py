"""Implicit Euler among colliders: solves that hold particles on colliders, with Coulomb's friction.

Contact after the solve could take from the particles that touch no more than their own momentum. A body would
sink into itself until its solve threw them down fast enough, and would follow a belt only as fast as its
lowest particles pull. So, as on a floor without colliders, the solve holds a particle that a collider
stopped: it gets the velocity of the surface along the normal. If it sticks, it gets that velocity in all
directions; if it slides, an impulse of friction. While impulses are off Coulomb's law the substep is solved
again, from the last solution: what would have to be pulled leaves, what sticks beyond friction slides, and
what friction would turn back sticks.
"""

from taichi_soft.bodies.kernels.particles import gravity_on
from taichi_soft.contact.distances.distance import signed_distance
from taichi_soft.contact.distances.sweep import TOUCHING
from taichi_soft.contact.fields import NO_COLLIDER
from taichi_soft.contact.kernels.rebound import add_normal_impulse
from taichi_soft.core.math.quaternion import spun, turned, turned_back
from taichi_soft.core.runtime import ti
from taichi_soft.elements.kernels.internal_forces import accumulate_forces
from taichi_soft.solver.kernels.conjugate_gradient import SLIDES, STICKS, solve_system
from taichi_soft.solver.kernels.implicit_euler import add_pin_reactions, assemble, keep_residual
from taichi_soft.solver.kernels.rigid_rotation import multiply

HARDEST = 1e24
"""Impulse [N s] from which the solve of a body torn to pieces has overflowed: a collider is told of none."""

MOST_SOLVES = 6
"""In one substep, to find which particles stick, slide and leave."""

CLOSE = 0.003
"""Error of the impulses by Coulomb's law, over their sum, at which a substep is not solved again."""

GIVEN_BACK = 0.1
"""Largest relative change of a sliding velocity where friction was too strong: a larger one keeps a body from
coming to rest."""


@ti.func
def _surface_velocity(contact: ti.template(), c, x, since, h):
    """Mean velocity in a substep of the point of a collider that is at `x` [m/s].

    Of a turning one that is the chord: along the tangent, what lies on it would spiral outwards.

    Returns: it, and the way from the collider's position to the point [m].
    """
    arm = x - contact.collider_position[c] - since * contact.collider_velocity[c]
    turn = spun(ti.Vector([0.0, 0.0, 0.0, 1.0]), h * contact.collider_spin[c])
    return contact.collider_velocity[c] + (turned(turn, arm) - arm) / h, arm


@ti.func
def _surface_below(contact: ti.template(), c, x, since):
    """Distance of a point from a collider's skin `since` [s] after the start of the step; normal there."""
    rotation = spun(contact.collider_rotation[c], contact.collider_spin[c] * since)
    place = x - contact.collider_position[c] - since * contact.collider_velocity[c]
    kind, parameters = contact.collider_kind[c], contact.collider_parameters[c]
    resolution, offset = contact.collider_resolution[c], contact.collider_offset[c]
    distance, normal = signed_distance(
        contact.samples, kind, parameters, resolution, offset, turned_back(rotation, place)
    )
    return distance - contact.collider_surface[c].z, turned(rotation, normal)


@ti.func
def _lay_on_colliders(state: ti.template(), body, h, since):
    """Hold particles that lie on colliders; release others.

    A particle lies there while gravity alone would bring it back within the substep. It sticks in the first
    solve if gravity alone could give it its sliding velocity within one.

    Returns: the number of particles that are held.
    """
    count, fall = 0, h * gravity_on(state, body).norm()
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        c = state.particle_contact[p] - 1
        state.particle_contact[p] = 0
        if c >= 0 and state.particle_inv_mass[p] > 0.0:
            mine, theirs = state.contact.body_filter[body], state.contact.collider_filter[c]
            x, v = state.particle_position[p], state.particle_velocity[p]
            distance, n = _surface_below(state.contact, c, x, since)
            surface_velocity, _ = _surface_velocity(state.contact, c, x, since, h)
            leaving = n.dot(v - surface_velocity)
            is_near = distance + h * leaving <= TOUCHING + h * fall
            if state.contact.collider_kind[c] != NO_COLLIDER and (mine[0] & theirs[1]) != 0 and is_near:
                if (theirs[0] & mine[1]) != 0:
                    velocity_so_far, _ = _surface_velocity(state.contact, c, x, since, -h)
                    sliding = v - velocity_so_far
                    sliding -= n.dot(sliding) * n
                    friction = state.contact.collider_surface[c].x
                    sticks = ti.select(friction > 0.0 and sliding.norm() <= fall, STICKS, SLIDES)
                    state.particle_contact[p] = c + 1
                    state.particle_hold[p] = ti.Vector([n.x, n.y, n.z, sticks])
                    state.hold_velocity[p] = surface_velocity - ti.max(distance - TOUCHING, 0.0) / h * n
                    state.hold_friction[p] = ti.Vector.zero(state.real, 3)
                    count += 1
    return count


@ti.func
def _hold(state: ti.template(), body):
    """Write velocities of particles on colliders to `solution`, and its residual to `residual`."""
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        if state.particle_contact[p] > 0:
            hold = state.particle_hold[p]
            missing = state.hold_velocity[p] - state.particle_velocity[p] - state.solution[p]
            change = ti.select(hold.w == STICKS, missing, missing.dot(hold.xyz) * hold.xyz)
            state.solution[p] = state.solution[p] + change
    multiply(state, body, state.solution, state.image)
    for p in range(particles[0], particles[1]):
        rest = state.particle_force[p].xyz - state.image[p]
        if state.particle_contact[p] > 0:
            rest += state.hold_friction[p]
        state.residual[p] = rest


@ti.func
def _contact_impulse(state: ti.template(), p):
    """Impulse of the last solve on a particle on a collider.

    Returns: its part along the normal [N s], its part across, the limit of that by friction, and the velocity
    of the particle relative to the surface, without the part along the normal [m/s].
    """
    hold = state.particle_hold[p]
    n = hold.xyz
    impulse = state.image[p] - state.particle_force[p].xyz
    pressing = n.dot(impulse)
    across = ti.select(hold.w == STICKS, impulse - pressing * n, state.hold_friction[p])
    sliding = state.particle_velocity[p] + state.solution[p] - state.hold_velocity[p]
    sliding -= n.dot(sliding) * n
    friction = state.contact.collider_surface[state.particle_contact[p] - 1].x
    return pressing, across, friction * ti.max(pressing, 0.0), sliding


@ti.func
def _judge(state: ti.template(), body):
    """Measure how far impulses are from Coulomb's law.

    Returns: sums over all particles [N s]: of impulses, of those that pull, of what is beyond friction where
    particles stick, and of the errors of friction where they slide.
    """
    total, pulling = ti.cast(0.0, state.real), ti.cast(0.0, state.real)
    beyond, wrong = ti.cast(0.0, state.real), ti.cast(0.0, state.real)
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        if state.particle_contact[p] > 0:
            pressing, across, most, sliding = _contact_impulse(state, p)
            size = across.norm()
            total += ti.abs(pressing) + size
            pulling += ti.max(-pressing, 0.0)
            if state.particle_hold[p].w == STICKS:
                beyond += ti.max(size - most, 0.0)
            elif across.dot(sliding) > 0.0:
                wrong += size
            else:
                wrong += ti.abs(most - size)
    return total, pulling, beyond, wrong


@ti.func
def _correct(state: ti.template(), body, releases):
    """Change what holds particles on colliders, and friction on them, after a solve.

    Args:
        releases: whether particles leave that colliders would have to pull (1).
    """
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        if state.particle_contact[p] > 0:
            pressing, across, most, sliding = _contact_impulse(state, p)
            size = across.norm()
            if pressing < 0.0 and releases == 1:
                state.particle_contact[p] = 0
            elif state.particle_hold[p].w == STICKS:
                if size > most:
                    state.particle_hold[p].w = SLIDES
                    state.hold_friction[p] = most / size * across
            elif across.dot(sliding) > 0.0:
                state.particle_hold[p].w = STICKS
            else:
                state.hold_friction[p] = -most / ti.max(sliding.norm(), 1e-30) * sliding


@ti.func
def _solve_on_colliders(state: ti.template(), program: ti.template(), body, h, since):
    """Solve a body as `solve_body` does, with the colliders that its particles lie on.

    Returns: the residual left, over the first.
    """
    count = _lay_on_colliders(state, body, h, since)
    accumulate_forces(state, program, body)
    assemble(state, program, body, h)
    residual, first, solves = ti.cast(0.0, state.real), ti.cast(0.0, ti.f64), 0
    while solves < MOST_SOLVES:
        if count > 0:
            _hold(state, body)
        residual, first = solve_system(state, body, first)
        multiply(state, body, state.solution, state.image)
        solves += 1
        if count == 0:
            solves = MOST_SOLVES
        elif solves < MOST_SOLVES:
            total, pulling, beyond, wrong = _judge(state, body)
            if pulling + beyond + wrong > CLOSE * total:
                _correct(state, body, int(beyond <= CLOSE * total))
            else:
                solves = MOST_SOLVES
    return residual


@ti.func
def _press(state: ti.template(), body, p, h, since):
    """Add the impulse of a particle on a collider to what the collider feels.

    Friction that the solves left too weak or too strong acts on the particle alone.

    Returns: the velocity of the particle [m/s].
    """
    c, mass = state.particle_contact[p] - 1, state.particle_mass[p]
    n = state.particle_hold[p].xyz
    pressing, across, most, sliding = _contact_impulse(state, p)
    if not ti.abs(pressing) + across.norm() < HARDEST:
        pressing, across = pressing * 0.0, across * 0.0
    elif state.particle_hold[p].w == SLIDES:
        momentum = mass * sliding.norm()
        brake = ti.min(ti.max(most - across.norm(), -GIVEN_BACK * momentum), momentum)
        share = brake / ti.max(momentum, 1e-30)
        across -= share * mass * sliding
        sliding *= 1.0 - share
    surface_velocity, arm = _surface_velocity(state.contact, c, state.particle_position[p], since, h)
    impulse = pressing * n + across
    row = body * state.contact.capacity.colliders + c
    state.contact.impulse[row] = state.contact.impulse[row] - impulse
    state.contact.angular_impulse[row] = state.contact.angular_impulse[row] - arm.cross(impulse)
    if pressing < 0.0:
        state.particle_contact[p] = 0
    else:
        state.contact.particle_touches[p] = 1
        if state.contact.collider_surface[c].y >= 0.0:
            along = n.dot(surface_velocity)
            add_normal_impulse(state.contact, row, pressing, n, along, along)
    return state.hold_velocity[p] + sliding


@ti.func
def kick_implicitly(state: ti.template(), program: ti.template(), body, h, since, is_first, common):
    """New velocities of one body from a solve, and in `direction` where its particles are.

    Args:
        since: time since the start of the step [s].
        is_first: 1 in the first substep of a step.
    Returns: the highest speed [m/s], and the highest beside the `common` velocity.
    """
    keep_residual(state, body, _solve_on_colliders(state, program, body, h, since), is_first)
    highest, highest_beside = ti.cast(0.0, state.real), ti.cast(0.0, state.real)
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        v = state.particle_velocity[p]
        state.contact.particle_touches[p] = 0
        if state.particle_inv_mass[p] == 0.0:
            state.solution[p] = state.particle_force[p].xyz - state.image[p]
        else:
            v += state.solution[p]
            if state.particle_contact[p] > 0:
                v = _press(state, body, p, h, since)
        state.particle_velocity[p] = v
        state.direction[p] = state.particle_position[p]
        state.particle_force[p] = ti.Vector.zero(state.real, 4)
        highest = ti.max(highest, v.dot(v))
        if ti.static(program.has_soft_contact):
            state.soft.particle_speed[p] = (v - common).norm()
            highest_beside = ti.max(highest_beside, (v - common).dot(v - common))
    add_pin_reactions(state, body, h)
    return ti.sqrt(highest), ti.sqrt(highest_beside)
