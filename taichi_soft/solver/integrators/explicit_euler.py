"""Explicit Euler (thesis section 3.5.1, eq. 3.16), for comparison only.

The energy grows in every oscillation.
"""

from taichi_soft.core.runtime import ti
from taichi_soft.core.types import Integrator
from taichi_soft.solver.integrators.explicit import add_forces, any_shape, before_each, whole_substep
from taichi_soft.solver.integrators.integrator_model import IntegratorModel
from taichi_soft.solver.kernels.kick import kick_by_forces


@ti.func
def advance(x, v, a, h, kick):
    """Return position and velocity after one substep, both computed from the old values."""
    return x + h * v, v + h * a


EXPLICIT_EULER = IntegratorModel(
    Integrator.EXPLICIT_EULER,
    felt_time=whole_substep,
    drive_time=before_each,
    hold=add_forces,
    predict=kick_by_forces,
    check=any_shape,
    advance=advance,
    only_flat=True,
    warning="explicit_euler gains energy at every substep, however short, and explodes sooner or later: use "
    "it for comparison only; use leapfrog otherwise",
)
