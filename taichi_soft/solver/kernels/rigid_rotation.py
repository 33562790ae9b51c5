"""Keep the stiffness matrix of implicit Euler from slowing down the rotation of a body.

Internal forces have no torque, but -K v has a torque, because K is projected and the forces belong to the old
positions. So K acts on velocities without the body's rotation, P v = v - W J W^T M v, and the matrix is P^T K
P. W maps an angular velocity to velocities, and J is the inverse of the inertia tensor. P^T K P is positive
semi-definite like K, and has no torque. It differs from K by a matrix of rank 6, so that products need only
the three columns of K W in addition to K.

A pinned body swings under gravity like a pendulum, with the frequency sqrt(g / r) for the radius of gyration
r.
Without stiffness in the system, a substep h is stable only for r > h^2 g / 4. So the inertia of the body's
mass at the radius h^2 g is added before J is computed. A small additional inertia makes J exist for bodies
along a straight line.
"""

from taichi_soft.bodies.kernels.particles import gravity_on
from taichi_soft.core.runtime import ti
from taichi_soft.elements.kernels.linear_system import add_edge_products

THIN = 1e-6
"""Moment of inertia that is added about every axis, as a fraction of the trace of the inertia tensor. It
keeps the tensor of a straight line invertible."""


@ti.func
def _cross_matrix(d):
    """Return the matrix C with C w = w x d for every angular velocity w."""
    zero = d.x * 0.0
    return ti.Matrix([[zero, d.z, -d.y], [-d.z, zero, d.x], [d.y, -d.x, zero]])


@ti.func
def _arm(state: ti.template(), body, p):
    """Return the vector from the centre of mass of a body to a particle [m]."""
    first = state.body_particles[body][0]
    return state.particle_position[p] - state.particle_position[first] - state.body_center[body]


@ti.func
def project_out_rotation(state: ti.template(), body, h):
    """Compute the fields that `multiply` needs. The blocks of the body must contain h^2 K."""
    particles, edges = state.body_particles[body], state.body_edges[body]
    first = state.particle_position[particles[0]]
    mass, center = ti.cast(0.0, state.real), ti.Vector.zero(state.real, 3)
    for p in range(particles[0], particles[1]):
        mass += state.particle_mass[p]
        center += state.particle_mass[p] * (state.particle_position[p] - first)
        state.particle_turning[p] = ti.Matrix.zero(state.real, 3, 3)
    state.body_center[body] = center / mass
    for e in range(edges[0], edges[1]):
        p, q = state.edge_vertices[e][0], state.edge_vertices[e][1]
        turning = _cross_matrix(state.particle_position[q] - state.particle_position[p])
        block = state.edge_block[e]
        state.particle_turning[p] = state.particle_turning[p] + block @ turning
        state.particle_turning[q] = state.particle_turning[q] - block.transpose() @ turning
    inertia, turning = ti.Matrix.zero(state.real, 3, 3), ti.Matrix.zero(state.real, 3, 3)
    for p in range(particles[0], particles[1]):
        matrix = _cross_matrix(_arm(state, body, p))
        inertia += state.particle_mass[p] * matrix.transpose() @ matrix
        turning += matrix.transpose() @ state.particle_turning[p]
    radius = h * h * gravity_on(state, body).norm()
    added = THIN * inertia.trace() + mass * radius * radius + 1e-30
    for i in ti.static(range(3)):
        inertia[i, i] += added
    scale = 1.0 / inertia.trace()  # without it, the determinant could overflow or underflow
    state.body_inverse_inertia[body] = scale * (scale * inertia).inverse()
    state.body_turning[body] = turning


@ti.func
def multiply(state: ti.template(), body, source: ti.template(), target: ti.template()):
    """Write the product of a body's system and `source` to `target`. In the system, P^T K P replaces K."""
    particles = state.body_particles[body]
    spin, torque = ti.Vector.zero(state.real, 3), ti.Vector.zero(state.real, 3)
    for p in range(particles[0], particles[1]):
        spin += state.particle_mass[p] * _arm(state, body, p).cross(source[p])
        torque += state.particle_turning[p].transpose() @ source[p]
    spin = state.body_inverse_inertia[body] @ spin
    turn = state.body_inverse_inertia[body] @ (torque - state.body_turning[body] @ spin)
    for p in range(particles[0], particles[1]):
        taken = state.particle_turning[p] @ spin
        taken += state.particle_mass[p] * turn.cross(_arm(state, body, p))
        target[p] = state.particle_inertia[p] * source[p] - taken
    add_edge_products(state, body, source, target)
