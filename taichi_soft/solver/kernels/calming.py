"""What lets a body come to rest that is nearly there: fast vibrations fade, slow ones and rigid motion stay.

Damping takes from every vibration at the rate of the slowest, so what is fast would hum on for half a minute
in a floppy body. Here pairs of neighbours lose what they have of velocity along the edge between them, one
pair after the other. That takes the more of a vibration the more its neighbours differ, and keeps momentum
and angular momentum.

A body that is slower than `sleep_speed` as a whole loses its slow vibrations too, in `vibration`: one limb
that swings would keep it awake.
"""

from taichi_soft.bodies.kernels.particles import gravity_on
from taichi_soft.core.constants import LANES, ROW_BITS
from taichi_soft.core.runtime import ti
from taichi_soft.solver.kernels.vibration import MOVING, felt_velocity

CALMING = 0.5
"""Part of the velocity along an edge that its ends lose in each step."""

SLOW_FACTOR = 10.0
"""Root mean square speed over mass, over `sleep_speed`, below which a body is slow."""


@ti.func
def update_rest_state(state: ti.template(), body):
    """Write to `rest_state` whether a damped body is moving, slow or resting, if bodies can fall asleep."""
    rest_state, sleep_speed = MOVING, state.contact.sleep_speed[None]
    if sleep_speed > 0.0 and state.body_fading[body] > 0.0:
        particles = state.body_particles[body]
        masses, motions = ti.Vector.zero(ti.f32, LANES), ti.Vector.zero(ti.f32, LANES)
        for block in range((particles[1] - particles[0] + LANES - 1) // LANES):
            first = (particles[0] + block * LANES) & ROW_BITS
            for lane in range(LANES):
                mass = ti.select(first + lane < particles[1], state.particle_mass[first + lane], 0.0)
                masses[lane] += mass
                motions[lane] += mass * state.particle_velocity[first + lane].norm_sqr()
        most, motion = masses.sum() * sleep_speed * sleep_speed, motions.sum()
        rest_state = int(motion <= SLOW_FACTOR * SLOW_FACTOR * most) + int(motion <= most)
    if state.contact.rest_state[body] != rest_state:
        state.contact.rest_state[body] = rest_state


@ti.func
def calm_body(state: ti.template(), program: ti.template(), body, kick, h, s, substeps):
    """Damp the fast vibrations of a body that is slow, in substep `s` of `substeps`.

    `kick` and `h` are those of `fade_vibration`. Each edge has its turn once in a step, and the edges of a
    particle at different times: one that vibrates once in a step would always be found standing still.
    """
    if state.contact.rest_state[body] != MOVING:
        _calm_edges(state, program, body, kick, h, s, substeps)


@ti.real_func
def _calm_edges(
    state: ti.template(),
    program: ti.template(),
    body: ti.i32,
    kick: ti.f32,
    h: ti.f32,
    s: ti.i32,
    substeps: ti.i32,
):
    gravity, edges = gravity_on(state, body), state.body_edges[body]
    e = edges[0] + s
    while e < edges[1]:
        p, q = state.edge_vertices[e][0], state.edge_vertices[e][1]
        # What touches is left to its contacts: between pushes a weight on it would creep.
        if state.contact.particle_touches[p] + state.contact.particle_touches[q] == 0:
            between = state.particle_position[q] - state.particle_position[p]
            apart = felt_velocity(state, program, q, gravity, kick, h, 1)
            apart -= felt_velocity(state, program, p, gravity, kick, h, 1)
            shares = state.particle_inv_mass[p] + state.particle_inv_mass[q]
            part = CALMING * apart.dot(between) / ti.max(between.norm_sqr() * shares, 1e-30)
            change_p = part * state.particle_inv_mass[p] * between
            change_q = part * state.particle_inv_mass[q] * between
            state.particle_velocity[p] = state.particle_velocity[p] + change_p
            state.particle_velocity[q] = state.particle_velocity[q] - change_q
        e += substeps
