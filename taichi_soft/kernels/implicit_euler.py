"""Implicit Euler (thesis section 3.5.3, eq. 3.26) of one body: one linear solve per substep.

(M + h D + h^2 K) dv = h (f + m g - h K v): forces of the old positions, and how they change on the way.
Particles that lie on the floor are held at its height within the solve, until it would have to pull them
down.
"""

from taichi_soft.collision.floor import resolve_floor
from taichi_soft.kernels.conjugate_gradient import invert_blocks, solve_system
from taichi_soft.kernels.linear_system import (
    add_damping,
    add_masses,
    add_stiffness,
    clear_system,
    multiply_system,
)
from taichi_soft.math.tensors import widened
from taichi_soft.runtime import ti


@ti.func
def assemble(state: ti.template(), program: ti.template(), body, h):
    """Fill the blocks, and `residual` with the right-hand side, kept in `particle_force` as well."""
    particles = state.body_particles[body]
    clear_system(state, body)
    add_stiffness(state, program, body, h * h)
    multiply_system(state, body, state.particle_velocity, state.image)
    for p in range(particles[0], particles[1]):
        inv_mass = state.particle_inv_mass[p]
        weight = state.gravity[None] / ti.max(inv_mass, 1e-30) * ti.select(inv_mass > 0.0, 1.0, 0.0)
        rhs = h * (state.particle_force[p].xyz + weight) - state.image[p]
        state.residual[p] = rhs
        state.particle_force[p] = widened(rhs)
    add_damping(state, program, body, h)
    add_masses(state, body)
    invert_blocks(state, body)


@ti.func
def _move(state: ti.template(), program: ti.template(), p, h):
    """Position and velocity of one particle after the solve; what the floor does with it."""
    if state.particle_inv_mass[p] > 0.0:
        v = state.particle_velocity[p] + state.solution[p]
        x = state.particle_position[p] + h * v
        if ti.static(program.has_floor):
            if state.particle_contact[p] == 1:
                push = state.image[p] - state.particle_force[p].xyz  # impulse of the floor [N s]
                slide = ti.sqrt(v.x * v.x + v.y * v.y)
                brake = state.floor[None].z * ti.max(push.z, 0.0) * state.particle_inv_mass[p]
                keep = ti.select(slide > brake, 1.0 - brake / ti.max(slide, 1e-30), 0.0)
                v.x, v.y, v.z = v.x * keep, v.y * keep, 0.0
                x = state.particle_position[p] + h * v
                if push.z < 0.0:
                    state.particle_contact[p] = 0
            else:
                falling = x.z < state.floor[None].x
                x, v = resolve_floor(x, v, h, state.floor[None])
                if falling and v.z == 0.0:
                    state.particle_contact[p] = 1
        state.particle_position[p] = x
        state.particle_velocity[p] = v
    state.particle_force[p] = ti.Vector.zero(state.real, 4)


@ti.func
def implicit_substep(state: ti.template(), program: ti.template(), body, h, is_first):
    """One substep of one body whose forces are in `particle_force`."""
    assemble(state, program, body, h)
    residual = solve_system(state, body)
    multiply_system(state, body, state.solution, state.image)
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        _move(state, program, p, h)
    if is_first == 1:
        state.body_residual[body] = residual
    else:
        state.body_residual[body] = ti.max(state.body_residual[body], residual)
