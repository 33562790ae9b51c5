"""What a fixed step does to one body among colliders before its first substep, and after its last."""

from taichi_soft.bodies.status import ABSENT, ACTIVE
from taichi_soft.contact.kernels.collide import forget_contacts
from taichi_soft.contact.kernels.rebound import begin_rebounds
from taichi_soft.contact.kernels.soft_search import forget_candidates
from taichi_soft.core.runtime import ti
from taichi_soft.core.types import Integrator
from taichi_soft.solver.kernels.per_body import end_body, remember_body


@ti.func
def begin_body(state: ti.template(), program: ti.template(), body):
    """Remember how a body is, to put it back there, and forget what it touched in the last step."""
    if state.body_status[body] != ABSENT:
        remember_body(state, body)
        particles = state.body_particles[body]
        if ti.static(state.capacity.implicit):
            for p in range(particles[0], particles[1]):
                state.prev_contact[p] = state.particle_contact[p]
        begin_rebounds(state, body)
        forget_contacts(state, body)
        state.contact.is_wild[body] = 0
        if ti.static(program.has_soft_contact):
            if state.body_status[body] != ACTIVE:
                state.contact.body_speed_beside[body] = 0.0
                for p in range(particles[0], particles[1]):
                    state.soft.particle_speed[p] = 0.0


@ti.func
def finish_body(state: ti.template(), program: ti.template(), body, substeps, h):
    """After the last substep; notes whether the body failed, or was not solved as exactly as asked."""
    state.contact.has_failed[body] = 0
    if state.body_status[body] == ACTIVE:
        if end_body(state, program, body, substeps, h) == 1:
            forget_contacts(state, body)  # it was put back: nothing has touched it
            state.contact.has_failed[body] = 1
        elif ti.static(program.integrator == Integrator.IMPLICIT_EULER):
            state.contact.has_failed[body] = int(state.body_residual[body] > state.solver[None][0])
    if ti.static(program.has_soft_contact):
        forget_candidates(state, body)
