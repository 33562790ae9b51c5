"""Implicit Euler (thesis section 3.5.3, eq. 3.26) of one body: one linear solve per substep.

The system is (M + h D + h^2 K) dv = h (f + m g - h K v), with masses M, damping D and stiffness K. Its
right-hand side contains the forces f at the old positions and the change of these forces along the path. K is
projected to be positive semi-definite, and acts only on motion without the body's rotation (see
`rigid_rotation`). The solve constrains particles that lie on colliders, as long as no impulse pulls them (see
`held_particles`).
"""

from taichi_soft.bodies.kernels.particles import gravity_on
from taichi_soft.bodies.status import FEELS_REACTION
from taichi_soft.control.kernels.grabs import add_grabs
from taichi_soft.core.math.tensors import widened
from taichi_soft.core.runtime import ti
from taichi_soft.elements.kernels.internal_forces import accumulate_forces
from taichi_soft.elements.kernels.linear_system import (
    add_damping,
    add_masses,
    add_stiffness,
    clear_system,
)
from taichi_soft.solver.kernels.conjugate_gradient import invert_blocks
from taichi_soft.solver.kernels.held_particles import solve_held
from taichi_soft.solver.kernels.rigid_rotation import multiply, project_out_rotation

FARTHEST = 0.5
"""Largest allowed change of an edge in a substep, as a fraction of its length. If an edge changes more, the
substep is halved."""

MIN_LENGTH = 0.1
"""Smallest length to which the change of an edge is compared, as a fraction of the root mean square edge
length. It prevents halving for very short edges."""

MAX_PIECES = 32
"""Largest number of parts into which a failing substep is divided."""


@ti.func
def assemble(state: ti.template(), program: ti.template(), body, h):
    """Fill the blocks of the matrix, and write the right-hand side to `residual` and `particle_force`.

    `solution` is set to zero.
    """
    particles = state.body_particles[body]
    clear_system(state, body)
    add_stiffness(state, program, body, h * h)
    project_out_rotation(state, body, h)
    multiply(state, body, state.particle_velocity, state.image)
    gravity = gravity_on(state, body)
    for p in range(particles[0], particles[1]):
        inv_mass = state.particle_inv_mass[p]
        weight = gravity / ti.max(inv_mass, 1e-30) * ti.select(inv_mass > 0.0, 1.0, 0.0)
        rhs = h * (state.particle_force[p].xyz + weight) - state.image[p]
        state.residual[p] = rhs
        state.particle_force[p] = widened(rhs)
        state.solution[p] = ti.Vector.zero(state.real, 3)
    add_grabs(state, body, h)
    add_damping(state, program, body, h)
    add_masses(state, body)
    invert_blocks(state, body)


@ti.func
def solve_body(state: ti.template(), program: ti.template(), body, h, held_count):
    """Assemble and solve the system of a body. For `held_count` and the results, see `solve_held`."""
    accumulate_forces(state, program, body)
    assemble(state, program, body, h)
    return solve_held(state, body, held_count, h)


@ti.func
def add_pin_reactions(state: ti.template(), body, h):
    """Accumulate the impulses on pinned particles in a substep of `h` [s]."""
    if state.body_drives[body] & FEELS_REACTION != 0:
        gravity = gravity_on(state, body)
        particles = state.body_particles[body]
        for p in range(particles[0], particles[1]):
            if state.particle_inv_mass[p] == 0.0:
                impulse = state.solution[p] + h * state.particle_mass[p] * gravity
                state.particle_reaction[p] = state.particle_reaction[p] + impulse


@ti.func
def record_residual(state: ti.template(), body, residual, is_first):
    """Record in `body_residual` the largest residual of all solves of a step. NaN residuals are ignored."""
    so_far = ti.select(is_first == 1, 0.0, state.body_residual[body])
    state.body_residual[body] = ti.select(residual > so_far, residual, so_far)


@ti.func
def _scale_motion(state: ti.template(), body, h, share):
    """Multiply a body's motion relative to its mean motion by `share`, in a substep of `h` [s]."""
    momentum, mass = ti.Vector.zero(state.real, 3), ti.cast(1e-30, state.real)
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        if state.particle_inv_mass[p] > 0.0:
            momentum += state.particle_mass[p] * state.particle_velocity[p]
            mass += state.particle_mass[p]
    for p in range(particles[0], particles[1]):
        if state.particle_inv_mass[p] > 0.0:
            common = momentum / mass
            v = common + share * (state.particle_velocity[p] - common)
            state.particle_position[p] = state.direction[p] + h * v
            state.particle_velocity[p] = v


@ti.func
def _largest_change(state: ti.template(), body):
    """Return the largest change of an edge in this substep, as a fraction of its length.

    `direction` contains the positions before the substep.
    """
    edges = state.body_edges[body]
    mean = ti.cast(0.0, state.real)
    for e in range(edges[0], edges[1]):
        r = state.direction[state.edge_vertices[e][1]] - state.direction[state.edge_vertices[e][0]]
        mean += r.dot(r)
    least = MIN_LENGTH * MIN_LENGTH * mean / (edges[1] - edges[0]) + 1e-30
    worst = ti.cast(0.0, state.real)
    for e in range(edges[0], edges[1]):
        p, q = state.edge_vertices[e][0], state.edge_vertices[e][1]
        r = state.direction[q] - state.direction[p]
        change = state.particle_position[q] - state.particle_position[p] - r
        worst = ti.max(worst, change.dot(change) / ti.max(r.dot(r), least))
    return ti.sqrt(worst)


@ti.func
def keeps_shape(state: ti.template(), body):
    """True if no edge changed by more than the fraction `FARTHEST` of its length in this substep."""
    return _largest_change(state, body) <= FARTHEST


@ti.func
def slow_down(state: ti.template(), body, h):
    """Slow a body down if an edge changed by more than the fraction `FARTHEST` in a substep of `h` [s]."""
    change = _largest_change(state, body)
    if change > FARTHEST:
        _scale_motion(state, body, h, FARTHEST / change)
