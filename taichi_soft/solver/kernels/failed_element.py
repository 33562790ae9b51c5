"""Find the element that made a body fail, by repeating the last step of the body."""

from taichi_soft.bodies.kernels.evaluate import accumulate_forces_one_by_one
from taichi_soft.bodies.kernels.origins import enter_local, leave_local
from taichi_soft.bodies.kernels.particles import restore_particle
from taichi_soft.bodies.kernels.rods import restore_frames, save_frames
from taichi_soft.contact.kernels.collide import clear_contacts
from taichi_soft.control.kernels.reactions import forget_loads
from taichi_soft.core.runtime import ti
from taichi_soft.elements.kernels.internal_forces import clear_forces
from taichi_soft.solver.kernels import flat
from taichi_soft.solver.kernels.substep import substep_alone
from taichi_soft.solver.step_fields import Moment


@ti.kernel
def find_failed_element(
    state: ti.template(),
    program: ti.template(),
    body: ti.i32,
    substeps: ti.i32,
    h: ti.f32,
    is_braked: ti.i32,
    found: ti.types.ndarray(dtype=ti.i32, ndim=1),
):
    """Repeat the last step of a frozen body up to the substep in which it fails, then restore the body.

    Args:
        found: receives the tetrahedron (block times `LANES` plus lane) or edge that failed first, and the
            substep. It stays unchanged if nothing fails.
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        is_open = 1
        enter_local(state, body, state.body_origin[body])
        state.body_is_braked[body] = is_braked
        if ti.static(state.capacity.rods):
            save_frames(state, body)  # snapshots do not contain what an earlier step saved
        for s in range(substeps + 1):
            if is_open == 1:
                broken = accumulate_forces_one_by_one(state, program, body)
                if broken >= 0:
                    found[0] = broken
                    found[1] = s
                    is_open = 0
                else:
                    clear_forces(state, body)
                    if ti.static(program.has_contact):
                        now = Moment(s=s, substeps=substeps, h=h, since=s * h, left=h * (substeps - s))
                        substep_alone(state, program, body, now)
                    else:
                        flat.substep_alone(state, program, body, h, s, substeps)
        state.body_is_braked[body] = 0
        particles = state.body_particles[body]
        for p in range(particles[0], particles[1]):
            restore_particle(state, p)
        if ti.static(state.capacity.rods):
            restore_frames(state, body)
        leave_local(state, body)
        clear_forces(state, body)
        forget_loads(state, body)
        if ti.static(program.has_contact):
            clear_contacts(state, body)
