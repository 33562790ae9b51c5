"""Make bodies skip one step. They take no time in that step, and then continue with their velocities.

If a moving body comes near, a skipping body is woken and makes the step (see `wake_island`).
"""

from taichi_soft.bodies.kernels.particles import save_particle
from taichi_soft.bodies.status import ACTIVE, PUSHED, SKIPPING
from taichi_soft.contact.kernels.collide import clear_contacts
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti
from taichi_soft.solver.kernels.sleep import store_boxes_of_skipping


@ti.kernel
def skip_bodies(state: ti.template(), bodies: ti.types.ndarray(dtype=ti.i32, ndim=1)):
    """Make bodies skip the next step, except bodies on which an applied force acts in that step."""
    ti.loop_config(serialize=True)
    for i in range(bodies.shape[0]):
        body = bodies[i]
        if state.body_status[body] == ACTIVE and state.body_drives[body] & PUSHED == 0:
            state.body_status[body] = SKIPPING


@ti.kernel
def begin_skips(state: ti.template(), body_count: ti.i32):
    """Update the boxes of the bodies that skip the next step."""
    ti.loop_config(serialize=True)
    for _ in range(1):
        store_boxes_of_skipping(state, body_count)


@ti.kernel
def end_skips(state: ti.template(), body_count: ti.i32) -> ti.i32:
    """Make the bodies that skipped a step active again.

    The current positions of these bodies become their previous positions, so that interpolation does not
    move them. Their contacts, and the forces of force fields on them, are cleared.

    Returns: the number of bodies that skipped the step.
    """
    skipped = 0
    ti.loop_config(serialize=True)
    for body in range(body_count):
        if state.body_status[body] == SKIPPING:
            particles = state.body_particles[body]
            p = particles[0]
            while p < particles[1]:
                save_particle(state, p)
                p = row_behind(p)
            if ti.static(state.capacity.has_contact):
                clear_contacts(state, body)
            state.body_drives[body] = state.body_drives[body] & ~PUSHED
            state.body_status[body] = ACTIVE
            skipped += 1
    return skipped
