"""Accumulate all internal forces of one body, in one thread."""

from taichi_soft.core.runtime import ti
from taichi_soft.core.types import DampingModel
from taichi_soft.elements.kernels.bonds import accumulate_pressures
from taichi_soft.elements.kernels.edges import accumulate_edge_forces
from taichi_soft.elements.kernels.elastic import accumulate_elastic_forces
from taichi_soft.elements.kernels.rods import accumulate_rod_forces
from taichi_soft.elements.kernels.shells import accumulate_shell_forces


@ti.func
def accumulate_forces(state: ti.template(), program: ti.template(), body):
    """Add all internal forces of one body to its particles."""
    for m, model in ti.static(enumerate(program.models)):
        if state.body_model[body] == m:
            if ti.static(model.reads_expansion):
                accumulate_pressures(state, body)
            if ti.static(model.is_shell):
                accumulate_shell_forces(state, body)
            if ti.static(model.is_rod):
                accumulate_rod_forces(state, body)
            if ti.static(model.has_tets):
                accumulate_elastic_forces(state, model, body)
            if ti.static(model.damping_model == DampingModel.EDGE):
                accumulate_edge_forces(state, model, body)


@ti.func
def clear_forces(state: ti.template(), body):
    """Set the forces on all particles of one body to zero."""
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        state.particle_force[p] = ti.Vector.zero(state.real, 4)
