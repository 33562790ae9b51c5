"""Conjugate gradients with a block-Jacobi preconditioner, for the particles of one body, in one thread.

After Baraff and Witkin 1998, section 5: what is held is filtered out of every residual and direction.
"""

from taichi_soft.core.runtime import ti
from taichi_soft.solver.kernels.rigid_rotation import multiply

SLIDES, STICKS = 0.0, 1.0
"""What holds a particle on the floor or a collider: along the normal only, or in all directions."""


@ti.func
def held(state: ti.template(), p, v):
    """`v` without what a pin, or the floor or a collider under particle `p`, takes up."""
    kept = v * ti.select(state.particle_inv_mass[p] > 0.0, 1.0, 0.0)
    if state.particle_contact[p] > 0:
        hold = state.particle_hold[p]
        kept -= ti.select(hold.w == STICKS, kept, kept.dot(hold.xyz) * hold.xyz)
    return kept


@ti.func
def _dot(a, b):
    """In float64: sums over a body would lose the digits that the tolerance asks for."""
    return ti.cast(a.dot(b), ti.f64)


@ti.func
def invert_blocks(state: ti.template(), body):
    """The preconditioner: the inverse of every block on the diagonal."""
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        if state.particle_inv_mass[p] > 0.0:
            state.particle_block_inverse[p] = state.particle_block[p].inverse()


@ti.func
def solve_system(state: ti.template(), body, so_far):
    """Solve blocks times solution = right-hand side, as `solver` asks.

    `solution` is the initial guess, and `residual` its residual, which is used up. Residuals are measured in
    the norm of the preconditioner.

    Args:
        so_far: square of an earlier residual. The tolerance is relative to the larger of the two.
    Returns: the residual left, over that one; the square of that one.
    """
    particles = state.body_particles[body]
    left = ti.cast(0.0, ti.f64)
    for p in range(particles[0], particles[1]):
        r = held(state, p, state.residual[p])
        d = held(state, p, state.particle_block_inverse[p] @ r)
        state.residual[p] = r
        state.direction[p] = d
        left += _dot(r, d)
    first = ti.max(left, so_far)
    tolerance, most_iterations = state.solver[None][0], ti.cast(state.solver[None][1], ti.i32)
    count = 0
    while count < most_iterations and left > tolerance * tolerance * first:
        multiply(state, body, state.direction, state.image)
        curvature = ti.cast(0.0, ti.f64)
        for p in range(particles[0], particles[1]):
            state.image[p] = held(state, p, state.image[p])
            curvature += _dot(state.direction[p], state.image[p])
        if curvature > 0.0:
            step = ti.cast(left / curvature, state.real)
            before = left
            left = ti.cast(0.0, ti.f64)
            for p in range(particles[0], particles[1]):
                state.solution[p] = state.solution[p] + step * state.direction[p]
                r = state.residual[p] - step * state.image[p]
                z = held(state, p, state.particle_block_inverse[p] @ r)
                state.residual[p] = r
                state.image[p] = z
                left += _dot(r, z)
            turn = ti.cast(left / before, state.real)
            for p in range(particles[0], particles[1]):
                state.direction[p] = state.image[p] + turn * state.direction[p]
            count += 1
        else:
            count = most_iterations  # rounding has left nothing to go along
    return ti.sqrt(ti.cast(left / ti.max(first, 1e-300), state.real)), first
