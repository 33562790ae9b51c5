"""Damp fast vibrations of slow bodies, so that they come to rest. `settling` slows down their rigid motion.

Material damping acts on all vibrations at the rate of the slowest vibration, so fast vibrations of a floppy
body would last for half a minute. Here the ends of each edge lose part of their relative velocity along the
edge, one edge after the other. The damping is stronger if neighbouring particles move against each other
more. It conserves momentum and angular momentum. Bodies without material damping are not damped.

If the overall speed of a body is below `sleep_speed`, `vibration` also damps its slow vibrations. Otherwise
one swinging limb would keep the body awake.

Groups of fields: writes islands.
"""

from taichi_soft.bodies.kernels.particles import gravity_on
from taichi_soft.core.constants import LANES, ROW_BITS
from taichi_soft.core.runtime import ti
from taichi_soft.solver.kernels.vibration import felt_velocity

CALMING = 0.5
"""Fraction by which damping reduces the relative velocity of an edge's ends, along the edge, in each step."""

SLOW_FACTOR = 10.0
"""Speed below which a body counts as slow, as a multiple of `sleep_speed`. It is compared with the root mean
square of the body's particle speeds, weighted by mass."""


@ti.func
def update_mean_speed(state: ti.template(), body):
    """Store the root mean square of a body's particle speeds, weighted by mass, if bodies can sleep."""
    if state.sleep_speed[None] > 0.0:
        particles = state.body_particles[body]
        masses, motions = ti.Vector.zero(ti.f32, LANES), ti.Vector.zero(ti.f32, LANES)
        for block in range((particles[1] - particles[0] + LANES - 1) // LANES):
            first = (particles[0] + block * LANES) & ROW_BITS
            for lane in range(LANES):
                mass = ti.select(first + lane < particles[1], state.particle_mass[first + lane], 0.0)
                masses[lane] += mass
                motions[lane] += mass * state.particle_velocity[first + lane].norm_sqr()
        state.islands.mean_speed[body] = ti.sqrt(motions.sum() / masses.sum())


@ti.func
def calm_body(state: ti.template(), program: ti.template(), body, kick, h, s, substeps):
    """Damp the fast vibrations of a slow body in substep `s` of `substeps`.

    Each edge is damped once per step, but the edges of a particle are damped in different substeps. If all
    edges were damped in one substep, a vibration with the period of the step would always be damped at its
    turning point. For `kick` and `h`, see `fade_vibration`.
    """
    limit = SLOW_FACTOR * state.sleep_speed[None]
    if state.body_fading[body] > 0.0 and limit > 0.0 and state.islands.mean_speed[body] <= limit:
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
        # Skip touched particles. If they were damped between contact impulses, loaded bodies would creep.
        if state.particle_touches[p] + state.particle_touches[q] == 0:
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
