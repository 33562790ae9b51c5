"""Functions shared by the explicit integrators, which use the forces of the old positions."""

from taichi_soft.control.kernels.drives import add_reactions
from taichi_soft.control.kernels.grabs import pull_grabs
from taichi_soft.core.runtime import ti
from taichi_soft.elements.kernels.internal_forces import accumulate_forces


@ti.func
def whole_substep(lag, h, s):
    """Time for which forces act in a substep: all of it [s]."""
    return h


@ti.func
def before_each(h, s, substeps):
    """Time for which external forces act before a substep: all of it; 0 after the last substep [s]."""
    return ti.select(s < substeps, h, 0.0)


@ti.func
def add_forces(state: ti.template(), program: ti.template(), body, h, felt):
    """Add internal forces, reactions of pins, and grabs."""
    accumulate_forces(state, program, body)
    add_reactions(state, body, felt)
    pull_grabs(state, body, h, felt)


@ti.func
def any_shape(state: ti.template(), body, h, is_last):
    """Accept every shape: `kick_by_forces` checks changes of velocity instead."""
    return 1
