"""Functions that all explicit integrators share. These integrators use the forces at the old positions."""

from taichi_soft.bodies.kernels.rods import spin_edges
from taichi_soft.control.kernels.drives import add_reactions
from taichi_soft.control.kernels.grabs import pull_grabs
from taichi_soft.core.runtime import ti
from taichi_soft.elements.kernels.internal_forces import accumulate_forces


@ti.func
def whole_substep(lag, h, s):
    """Return the time for which forces act in a substep: the whole substep [s]."""
    return h


@ti.func
def before_each(h, s, substeps):
    """Return the time for which external forces act before substep `s` [s]; 0 if `s` equals `substeps`."""
    return ti.select(s < substeps, h, 0.0)


@ti.func
def add_forces(state: ti.template(), program: ti.template(), body, h, felt):
    """Add internal forces, reactions of pins, and forces of grabs."""
    accumulate_forces(state, program, body)
    if ti.static(state.capacity.rods):
        spin_edges(state, body, h, felt)
    add_reactions(state, body, felt)
    pull_grabs(state, body, h, felt)


@ti.func
def any_shape(state: ti.template(), body, h, is_last):
    """Return 1, because explicit integrators accept every shape. `kick_by_forces` checks velocities."""
    return 1
