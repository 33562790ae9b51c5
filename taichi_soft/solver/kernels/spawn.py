"""Spawn and despawn bodies, and switch them off and on. Only one slot is written; the rest of the world does
not change.
"""

from taichi_soft.bodies.kernels.origins import choose_origin, place_particle
from taichi_soft.bodies.kernels.plasticity import restore_shape
from taichi_soft.bodies.kernels.rods import place_frames
from taichi_soft.bodies.status import ABSENT, ACTIVE, DISABLED, FROZEN, FROZEN_DISABLED, JUST_PLACED
from taichi_soft.contact.kernels.candidates import clear_kept_impulses
from taichi_soft.contact.kernels.collide import clear_contacts
from taichi_soft.contact.kernels.hull_colliders import clear_warm_start
from taichi_soft.core.math.rows import row_at, row_behind
from taichi_soft.core.runtime import ti


@ti.kernel
def spawn_body(
    state: ti.template(),
    body: ti.i32,
    rows: ti.types.ndarray(dtype=ti.f32, ndim=2),
    group: ti.i32,
    mask: ti.i32,
):
    """Place a body in its slot, in the state of a body at the start of a world.

    Args:
        rows: position [m], velocity [m/s], inverse mass [1/kg], mass [kg] and rounding error of the position
            of each vertex in the caller's order, (n, 11).
        group, mask: bits of its asset, for contact.
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        begin = state.body_particles[body][0]
        choose_origin(state, body, row_at(rows, 0, 0))
        i = 0
        while i < rows.shape[0]:
            p = state.particle_of_vertex[begin + i]
            v = row_at(rows, i, 3)
            place_particle(state, body, p, row_at(rows, i, 0), row_at(rows, i, 8))
            state.prev_position[p] = state.particle_position[p]
            state.particle_velocity[p] = v
            state.prev_velocity[p] = v
            state.particle_force[p] = ti.Vector.zero(state.real, 4)
            state.particle_inv_mass[p] = rows[i, 6]
            state.particle_mass[p] = rows[i, 7]
            state.particle_aim[p] = 0
            if ti.static(state.capacity.implicit):
                state.particle_contact[p] = 0
            i = row_behind(i)
        for field, start in ti.static(state.body_starts):
            field[body] = start
        if ti.static(state.capacity.plastic):
            restore_shape(state, body)
        if ti.static(state.capacity.rods):
            place_frames(state, body)
        state.body_filter[body] = ti.Vector([group, mask])
        state.body_overlap[body] = JUST_PLACED
        particles = state.body_particles[body]
        p = particles[0]
        while p < particles[1]:
            state.particle_touches[p] = 0
            p = row_behind(p)
        if ti.static(state.capacity.contact.hull):
            clear_warm_start(state, body)
        if ti.static(state.capacity.contact.soft):
            clear_kept_impulses(state, body)
        state.body_status[body] = ACTIVE


@ti.kernel
def disable_body(state: ti.template(), body: ti.i32):
    """Switch a body off: no kernel steps or tests it until `enable_body`. Its motion stays in the fields."""
    ti.loop_config(serialize=True)
    for _ in range(1):
        particles = state.body_particles[body]
        p = particles[0]
        while p < particles[1]:
            state.prev_position[p] = state.particle_position[p]  # interpolated frames stand still
            p = row_behind(p)
        clear_contacts(state, body)  # otherwise colliders would receive the last impulse in every step
        is_frozen = state.body_status[body] == FROZEN
        state.body_status[body] = ti.select(is_frozen, FROZEN_DISABLED, DISABLED)


@ti.kernel
def enable_body(state: ti.template(), body: ti.i32):
    """Switch a body on again, awake unless it is frozen."""
    is_frozen = state.body_status[body] == FROZEN_DISABLED
    state.body_status[body] = ti.select(is_frozen, FROZEN, ACTIVE)
    state.body_calm_time[body] = 0.0


@ti.kernel
def despawn_body(state: ti.template(), body: ti.i32):
    """Empty a slot. The positions of its particles stay finite, but no code moves or reads them."""
    if ti.static(state.capacity.contact.colliders > 0):
        clear_contacts(state, body)  # otherwise colliders would receive the last impulse in every step
    state.body_status[body] = ABSENT
