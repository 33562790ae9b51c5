"""Constrain particles to the floor or colliders in the solve of implicit Euler, with Coulomb friction.

If contact acted after the solve, it could remove only the momentum of the touching particles. The rest of the
body would sink onto these particles, and a conveyor belt would accelerate the body only as fast as its lowest
particles pull the rest. So the solve constrains each touching particle. Along the normal, the particle has
the velocity of the surface. A sticking particle has the surface velocity in all directions; a sliding
particle receives an impulse of friction. While impulses violate Coulomb's law, the system is solved again,
starting from the last solution. Before each new solve, particles that would be pulled are released, particles
that stick beyond the friction limit begin to slide, and particles stick if friction would reverse their
sliding.

Groups of fields: reads colliders.
"""

from taichi_soft.core.runtime import ti
from taichi_soft.solver.kernels.conjugate_gradient import SLIDES, STICKS, solve_system, squared_load
from taichi_soft.solver.kernels.rigid_rotation import multiply

MAX_IMPULSE = 1e24
"""Largest valid impulse [N s]. Larger impulses come from overflow in a solve, and are replaced by zero."""

MAX_SOLVES = 6
"""Largest number of solves per body and substep. After each solve, some particles begin to stick or slide, or
are released."""

TOLERANCE = 0.003
"""Largest accepted violation of Coulomb's law, as a fraction of the sum of all impulses. If the violation is
larger, the system is solved again."""

MAX_REVERSAL = 0.1
"""Largest increase of a sliding velocity if friction was too strong, as a fraction of that velocity. Larger
increases would prevent bodies from coming to rest."""


@ti.func
def _friction_on(state: ti.template(), p):
    """Return the friction coefficient of the collider under a particle."""
    return state.colliders.surface[state.particle_contact[p] - 1].x


@ti.func
def constrain_particle(state: ti.template(), p, n, sliding, surface_velocity, fall):
    """Constrain a particle to the collider in `particle_contact`.

    In the first solve, the particle sticks if it slides no faster than `fall`.

    Args:
        n: normal of the surface.
        sliding: velocity relative to the surface before the substep [m/s]; its component along `n` is
            ignored.
        surface_velocity: mean velocity of the surface in the substep [m/s].
        fall: change of velocity due to gravity in a substep [m/s].
    """
    across = sliding - n.dot(sliding) * n
    sticks = ti.select(_friction_on(state, p) > 0.0 and across.norm() <= fall, STICKS, SLIDES)
    state.particle_hold[p] = ti.Vector([n.x, n.y, n.z, sticks])
    state.hold_velocity[p] = surface_velocity
    state.hold_friction[p] = ti.Vector.zero(state.real, 3)


@ti.func
def _begin_solve(state: ti.template(), body):
    """Write the velocities of constrained particles to `solution`, and the residual of `solution` to
    `residual`.
    """
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
def _impulse_of(state: ti.template(), p):
    """Return the impulse of the last solve on a constrained particle.

    Returns: component of the impulse along the normal, tangential component, largest tangential component
        that friction allows [N s]; and tangential velocity of the particle relative to the surface [m/s].
    """
    hold = state.particle_hold[p]
    n = hold.xyz
    impulse = state.image[p] - state.particle_force[p].xyz
    pressing = n.dot(impulse)
    across = ti.select(hold.w == STICKS, impulse - pressing * n, state.hold_friction[p])
    sliding = state.particle_velocity[p] + state.solution[p] - state.hold_velocity[p]
    sliding -= n.dot(sliding) * n
    return pressing, across, _friction_on(state, p) * ti.max(pressing, 0.0), sliding


@ti.func
def _measure_errors(state: ti.template(), body):
    """Measure how far impulses violate Coulomb's law.

    Returns: four sums over all particles [N s]: all impulses; impulses that pull; impulses of sticking
        particles in excess of the friction limit; errors of the friction on sliding particles.
    """
    total, pulling = ti.cast(0.0, state.real), ti.cast(0.0, state.real)
    beyond, wrong = ti.cast(0.0, state.real), ti.cast(0.0, state.real)
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        if state.particle_contact[p] > 0:
            pressing, across, most, sliding = _impulse_of(state, p)
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
def _update_constraints(state: ti.template(), body, releases):
    """Update the constraints and the friction of particles after a solve.

    Args:
        releases: 1 to release particles that are pulled.
    """
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        if state.particle_contact[p] > 0:
            pressing, across, most, sliding = _impulse_of(state, p)
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
def solve_held(state: ti.template(), body, held_count, h):
    """Solve the system of a body with `held_count` constrained particles.

    `solution` receives the changes of velocity [m/s], and `image` the system times these changes [N s].

    Returns: the remaining residual divided by the load.
    """
    load = squared_load(state, body, h)
    residual, solves = ti.cast(0.0, state.real), 0
    while solves < MAX_SOLVES:
        if held_count > 0:
            _begin_solve(state, body)
        residual = solve_system(state, body, load)
        multiply(state, body, state.solution, state.image)
        solves += 1
        if held_count == 0:
            solves = MAX_SOLVES
        elif solves < MAX_SOLVES:
            total, pulling, beyond, wrong = _measure_errors(state, body)
            if pulling + beyond + wrong > TOLERANCE * total:
                _update_constraints(state, body, int(beyond <= TOLERANCE * total))
            else:
                solves = MAX_SOLVES
    return residual


@ti.func
def held_velocity(state: ti.template(), p):
    """Return the velocity of a constrained particle after the solve.

    The function also corrects the remaining error of friction, for this particle alone and without adding
    energy.

    Returns: velocity [m/s], impulse along the normal, and tangential impulse [N s].
    """
    pressing, across, most, sliding = _impulse_of(state, p)
    if not ti.abs(pressing) + across.norm() < MAX_IMPULSE:
        pressing, across = ti.cast(0.0, state.real), ti.Vector.zero(state.real, 3)
    elif state.particle_hold[p].w == SLIDES:
        momentum = state.particle_mass[p] * sliding.norm()
        brake = ti.min(ti.max(most - across.norm(), -MAX_REVERSAL * momentum), momentum)
        if across.dot(sliding) > 0.0:
            brake = momentum
        share = brake / ti.max(momentum, 1e-30)
        across -= share * state.particle_mass[p] * sliding
        sliding *= 1.0 - share
    return state.hold_velocity[p] + sliding, pressing, across
