"""Implicit Euler (thesis section 3.5.3, eq. 3.26): the forces are those of the new positions.

One linear solve per substep and body (`solver.kernels.implicit_euler`) finds them, with grabs, pins and the
colliders that particles lie on in its equations. It takes forces as linear, so a substep in which a shape
changes by too much is made again in halves.
"""

from taichi_soft.core.runtime import ti
from taichi_soft.core.types import Integrator
from taichi_soft.solver.integrators.explicit import before_each
from taichi_soft.solver.integrators.model import IntegratorModel
from taichi_soft.solver.kernels.implicit_euler import MAX_PIECES, keeps_shape, slow_down
from taichi_soft.solver.kernels.implicit_kick import kick_implicitly


@ti.func
def felt_time(lag, h, s):
    """Forces of the old positions do not act [s]."""
    return 0.0 * h


@ti.func
def hold(state: ti.template(), program: ti.template(), body, h, felt):
    """All forces are in the equations."""


@ti.func
def predict(state: ti.template(), program: ti.template(), body, job, felt):
    """New velocities from the solve."""
    speed, beside = kick_implicitly(state, program, body, job.h, job.since, int(job.s == 0), job.velocity)
    return speed, beside, beside, 1


@ti.func
def check(state: ti.template(), body, h, is_last):
    """Check the shape. In the last attempt, slow a body down whose shape changed too much."""
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
    has_hulls=False,  # it holds vertices
    drifts_at_once=False,
    halvings=MAX_PIECES.bit_length() - 1,
    work=50,  # so many products with the matrix
)
