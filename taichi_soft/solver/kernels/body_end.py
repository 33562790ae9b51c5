"""End the step of one body."""

from taichi_soft.bodies.kernels.particles import restore_particle
from taichi_soft.bodies.kernels.plasticity import flow_body
from taichi_soft.bodies.status import ACTIVE, FROZEN, PUSHED
from taichi_soft.contact.kernels.candidates import clear_candidates
from taichi_soft.contact.kernels.collide import clear_contacts
from taichi_soft.contact.kernels.hull_points import place_points
from taichi_soft.control.kernels.drives import apply_external_forces
from taichi_soft.control.kernels.reactions import forget_loads
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti
from taichi_soft.elements.kernels.internal_forces import clear_forces
from taichi_soft.solver.kernels.attempts import body_is_valid
from taichi_soft.solver.kernels.sleep import update_rest_timer
from taichi_soft.solver.kernels.untangling import untangle_body


@ti.func
def _freeze_if_invalid(state: ti.template(), body):
    """If a body is invalid, restore its last valid state and freeze it. Returns: 1 if the body was frozen."""
    sound = body_is_valid(state, body)
    if sound == 0:
        particles = state.body_particles[body]
        p = particles[0]
        while p < particles[1]:
            restore_particle(state, p)
            p = row_behind(p)
        place_points(state, body)  # non-finite points would make snapshots invalid
        clear_forces(state, body)
        forget_loads(state, body)
        state.body_status[body] = FROZEN
    return 1 - sound


@ti.func
def _end_active_body(state: ti.template(), program: ti.template(), body, substeps, h):
    """End the step of an active body. Returns: see `end_body`."""
    apply_external_forces(state, body, program.integrator.drive_time(h, substeps, substeps))
    failed = _freeze_if_invalid(state, body)
    if failed == 0:
        state.body_velocity_lag[body] = h
        state.body_drives[body] = state.body_drives[body] & ~PUSHED
        if ti.static(program.has_plasticity):
            flow_body(state, body, substeps * h)
        failed = untangle_body(state, program, body, substeps * h)
        if ti.static(state.capacity.has_contact):
            update_rest_timer(state, body, substeps * h)
        if ti.static(state.capacity.implicit):
            failed = failed | int(state.body_residual[body] > state.solver[None][0])
    else:
        clear_contacts(state, body)  # the contacts belong to the undone step
    return failed


@ti.real_func
def end_body(
    state: ti.template(), program: ti.template(), body: ti.i32, substeps: ti.i32, h: ti.f32
) -> ti.i32:
    """End the step of a body after `substeps` substeps of `h` [s]: apply external forces and plastic flow,
    and restore inverted tetrahedra.

    Returns: 1 if the body failed, stays inverted, or was solved inexactly.
    """
    failed = 0
    if state.body_status[body] == ACTIVE:
        failed = _end_active_body(state, program, body, substeps, h)
    if ti.static(program.has_soft_contact):
        clear_candidates(state, body)
    return failed
