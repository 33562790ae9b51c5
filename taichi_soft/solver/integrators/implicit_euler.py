"""Implicit Euler (thesis section 3.5.3, eq. 3.26), with the forces at the new positions.

One linear solve per substep and body (`solver.kernels.implicit_solve`) finds these forces. The equations
include grabs, pins and the colliders under the body. Forces are linearised, so a substep that changes a shape
too much is retried as two halves.
"""

from taichi_soft.core.runtime import ti
from taichi_soft.core.types import Integrator
from taichi_soft.solver.integrators.explicit import before_each
from taichi_soft.solver.integrators.integrator_model import IntegratorModel
from taichi_soft.solver.kernels.implicit_kick import kick_implicitly
from taichi_soft.solver.kernels.implicit_solve import MAX_PIECES, keeps_shape, slow_down


@ti.func
def felt_time(lag, h, s):
    """Return 0 s, because the forces at the old positions do not act."""
    return 0.0 * h


@ti.func
def hold(state: ti.template(), program: ti.template(), body, h, felt):
    """Do nothing, because the equations contain all forces."""


@ti.func
def predict(state: ti.template(), program: ti.template(), body, job, felt):
    """Solve for the new velocities of a body. Returns: see `IntegratorModel.predict`."""
    speed, beside = kick_implicitly(state, program, body, job.h, job.since, int(job.s == 0), job.velocity)
    return speed, beside, beside, 1


@ti.func
def check(state: ti.template(), body, h, is_last):
    """Return 1 if the body kept its shape in the substep.

    In the last attempt, a body whose shape changed too much is first slowed down.
    """
    if is_last == 1:
        slow_down(state, body, h)
    return int(keeps_shape(state, body))


IMPLICIT_EULER = IntegratorModel(
    Integrator.IMPLICIT_EULER,
    felt_time=felt_time,
    drive_time=before_each,
    hold=hold,
    predict=predict,
    check=check,
    has_stable_step=False,
    has_hulls=False,  # the solve constrains vertices only
    drifts_at_once=False,
    halvings=MAX_PIECES.bit_length() - 1,
    work=50,  # a solve needs about 50 matrix products
)
