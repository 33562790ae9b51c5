"""Conjugate gradients with a block-Jacobi preconditioner, for the particles of one body, in one thread.

Following Baraff and Witkin 1998, section 5, constrained components are removed from every residual and
direction.
"""

from taichi_soft.bodies.kernels.particles import gravity_on
from taichi_soft.core.runtime import ti
from taichi_soft.solver.kernels.rigid_rotation import multiply

SLIDES, STICKS = 0.0, 1.0
"""Constraints of a touching particle. SLIDES constrains its velocity along the normal, STICKS in all
directions."""


@ti.func
def constrained(state: ti.template(), p, v):
    """Return `v` without the components that a pin, the floor or a collider constrains at particle `p`."""
    kept = v * ti.select(state.particle_inv_mass[p] > 0.0, 1.0, 0.0)
    if state.particle_contact[p] > 0:
        hold = state.particle_hold[p]
        kept -= ti.select(hold.w == STICKS, kept, kept.dot(hold.xyz) * hold.xyz)
    return kept


@ti.func
def _dot(a, b):
    """Return the dot product in float64, because float32 sums over a body would be less precise than the
    tolerance.
    """
    return ti.cast(a.dot(b), ti.f64)


@ti.func
def invert_blocks(state: ti.template(), body):
    """Compute the preconditioner, which consists of the inverses of the diagonal blocks."""
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        if state.particle_inv_mass[p] > 0.0:
            state.particle_block_inverse[p] = state.particle_block[p].inverse()


@ti.func
def _squared_norm(state: ti.template(), p, impulse):
    """Return the square of an impulse on a particle in the norm of the preconditioner."""
    return _dot(impulse, state.particle_block_inverse[p] @ impulse)


@ti.func
def squared_load(state: ti.template(), body, h):
    """Return the square of the load in a substep of `h` [s]. The tolerance is relative to the load.

    The load is the impulse of the weight or the right-hand side, whichever is larger. Both impulses include
    the part that floor and colliders support. Without that part, the right-hand side of a body at rest would
    consist of rounding errors.
    """
    weight, total = ti.cast(0.0, ti.f64), ti.cast(0.0, ti.f64)
    gravity = gravity_on(state, body)
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        if state.particle_inv_mass[p] > 0.0:
            weight += _squared_norm(state, p, h * state.particle_mass[p] * gravity)
            total += _squared_norm(state, p, state.particle_force[p].xyz)
    return ti.max(weight, total)


@ti.func
def _correct_common_velocity(state: ti.template(), body):
    """Add a common change of velocity of all particles to `solution`, and update `residual`.

    Each call corrects one direction. Before the iterations, the correction solves the system of a body in
    free fall, for which conjugate gradients need many iterations. After the iterations, the correction
    removes the momentum in the residual, which would make bodies slide faster or creep on slopes.
    """
    particles = state.body_particles[body]
    total, mass = ti.Vector.zero(state.real, 3), ti.cast(1e-30, state.real)
    for p in range(particles[0], particles[1]):
        total += constrained(state, p, state.residual[p])
        mass += state.particle_mass[p]
    for p in range(particles[0], particles[1]):
        state.direction[p] = constrained(state, p, total / mass)
    multiply(state, body, state.direction, state.image)
    gain, curvature = ti.cast(0.0, ti.f64), ti.cast(0.0, ti.f64)
    for p in range(particles[0], particles[1]):
        gain += _dot(state.direction[p], state.residual[p])
        curvature += _dot(state.direction[p], state.image[p])
    if curvature > 0.0:
        share = ti.cast(gain / curvature, state.real)
        for p in range(particles[0], particles[1]):
            state.solution[p] = state.solution[p] + share * state.direction[p]
            state.residual[p] = state.residual[p] - share * state.image[p]


@ti.func
def solve_system(state: ti.template(), body, load):
    """Solve the linear system of a body for `solution`, to the tolerance in `solver`.

    Before the call, `solution` must contain the initial guess, and `residual` the residual of that guess.
    Both fields are overwritten. Residuals are measured in the norm of the preconditioner.

    Args:
        load: result of `squared_load`, to which the tolerance is relative.
    Returns: the remaining residual divided by the load.
    """
    _correct_common_velocity(state, body)
    particles = state.body_particles[body]
    left = ti.cast(0.0, ti.f64)
    for p in range(particles[0], particles[1]):
        r = constrained(state, p, state.residual[p])
        d = constrained(state, p, state.particle_block_inverse[p] @ r)
        state.residual[p] = r
        state.direction[p] = d
        left += _dot(r, d)
    tolerance, most_iterations = state.solver[None][0], ti.cast(state.solver[None][1], ti.i32)
    count = 0
    while count < most_iterations and left > tolerance * tolerance * load:
        multiply(state, body, state.direction, state.image)
        curvature = ti.cast(0.0, ti.f64)
        for p in range(particles[0], particles[1]):
            state.image[p] = constrained(state, p, state.image[p])
            curvature += _dot(state.direction[p], state.image[p])
        if curvature > 0.0:
            step = ti.cast(left / curvature, state.real)
            before = left
            left = ti.cast(0.0, ti.f64)
            for p in range(particles[0], particles[1]):
                state.solution[p] = state.solution[p] + step * state.direction[p]
                r = state.residual[p] - step * state.image[p]
                z = constrained(state, p, state.particle_block_inverse[p] @ r)
                state.residual[p] = r
                state.image[p] = z
                left += _dot(r, z)
            turn = ti.cast(left / before, state.real)
            for p in range(particles[0], particles[1]):
                state.direction[p] = state.image[p] + turn * state.direction[p]
            count += 1
        else:
            count = most_iterations  # stop: only rounding errors remain
    _correct_common_velocity(state, body)
    return ti.sqrt(ti.cast(left / ti.max(load, 1e-300), state.real))
