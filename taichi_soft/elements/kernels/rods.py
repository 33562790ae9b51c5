"""Forces of rods, and moments about their edges.

The row of an edge is the particle at its first end. Rows of joints are those of the particles at the joints.
Between two substeps, `rod_frame` has the direction that an edge had in the last evaluation of forces, and the
rotation about this direction that belongs to the new positions.
"""

from taichi_soft.core.math.quaternion import turned, turned_back
from taichi_soft.core.runtime import ti
from taichi_soft.elements.laws.rod import (
    SHORTEST,
    edge_direction,
    followed,
    half_strain,
    joint_moment,
)

OPEN, CLOSED = 1, 2
"""Values of `body_rod`: a rod with two ends, a ring. The value of other bodies is 0."""

COLLAPSED = 1e-4
"""Length of an edge, relative to its length at rest, below which it keeps its direction."""


@ti.func
def edges_end(state: ti.template(), body):
    """Return the row after the last edge of a rod."""
    return state.body_particles[body][1] - int(state.body_rod[body] == OPEN)


@ti.func
def particle_after(state: ti.template(), body, p):
    """Return the particle after `p`. The first one follows the last one."""
    particles = state.body_particles[body]
    return ti.select(p + 1 < particles[1], p + 1, particles[0])


@ti.func
def direction_of(state: ti.template(), p, q):
    """Return the direction of the edge from particle `p` to `q`, and its inverse length as a lever arm [1/m].

    A collapsed edge has the direction of its frame.
    """
    along, length = state.particle_position[q] - state.particle_position[p], state.rod_edge[p].x
    now = ti.sqrt(along.dot(along) + 1e-30)
    direction = along / now
    if now < COLLAPSED * length:
        direction = edge_direction(state.rod_frame[p])
    return direction, 1.0 / ti.max(now, SHORTEST * length)


@ti.func
def _follow_edges(state: ti.template(), body):
    """Turn the frames to the directions of their edges, and store the angular velocities of the edges."""
    for p in range(state.body_particles[body][0], edges_end(state, body)):
        q = particle_after(state, body, p)
        direction, inverse = direction_of(state, p, q)
        state.rod_frame[p] = followed(state.rod_frame[p], direction)
        apart = state.particle_velocity[q] - state.particle_velocity[p]
        state.rod_rate[p] = direction.cross(apart) * inverse + state.rod_spin[p] * direction


@ti.func
def _bend_joints(state: ti.template(), body):
    """Store the moment of each joint on the edge after it [N m]. The edge before it has the opposite one."""
    particles = state.body_particles[body]
    first, last = particles[0], particles[1] - 1
    for p in range(first, last + 1):
        moment = ti.Vector.zero(state.real, 3)
        if state.body_rod[body] == CLOSED or (p > first and p < last):
            before = ti.select(p > first, p - 1, last)
            frame = state.rod_frame[before]
            rate = turned_back(frame, state.rod_rate[p] - state.rod_rate[before])
            s = half_strain(frame, state.rod_frame[p])
            moment = turned(frame, joint_moment(s, rate, state.rod_joint[p], state.rod_rest[p]))
        state.rod_moment[p] = moment


@ti.func
def _pull_edges(state: ti.template(), body):
    """Add the forces of stretching and of moments to the particles, and store the moments about the edges."""
    for p in range(state.body_particles[body][0], edges_end(state, body)):
        q = particle_after(state, body, p)
        constants, direction = state.rod_edge[p], edge_direction(state.rod_frame[p])
        _, inverse = direction_of(state, p, q)
        moment = state.rod_moment[p] - state.rod_moment[q]
        state.rod_torque[p] = moment.dot(direction)
        swing = state.rod_rate[p].cross(direction)  # derivative of the direction
        gyroscopic = constants.z * state.rod_spin[p] * swing
        along = state.particle_position[q] - state.particle_position[p]
        tension = constants.y * (along.norm() / constants.x - 1.0)
        force = tension * direction - (moment - gyroscopic).cross(direction) * inverse
        wide = ti.Vector([force.x, force.y, force.z, force.x * 0.0])
        # No `+=`: Taichi would make it atomic, although only one thread owns the body.
        state.particle_force[p] = state.particle_force[p] + wide
        state.particle_force[q] = state.particle_force[q] - wide


@ti.real_func
def accumulate_rod_forces(state: ti.template(), body: ti.i32):
    """Add the forces of one rod to its particles, and store the moments about its edges, in one thread."""
    _follow_edges(state, body)
    _bend_joints(state, body)
    _pull_edges(state, body)
