"""Lazy leapfrog (thesis section 3.5.2): explicit Euler with its two updates swapped."""

from taichi_soft.core.types import Integrator
from taichi_soft.solver.integrators.explicit import add_forces, any_shape, before_each, whole_substep
from taichi_soft.solver.integrators.integrator_model import IntegratorModel
from taichi_soft.solver.integrators.leapfrog import advance
from taichi_soft.solver.kernels.kick import kick_by_forces

LAZY_LEAPFROG = IntegratorModel(
    Integrator.LAZY_LEAPFROG,
    felt_time=whole_substep,
    drive_time=before_each,
    hold=add_forces,
    predict=kick_by_forces,
    check=any_shape,
    advance=advance,
    lag=0.5,  # approximate, but as accurate as the method itself
)
