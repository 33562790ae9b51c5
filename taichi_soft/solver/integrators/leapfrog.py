"""Leapfrog (thesis section 3.5.2, eq. 3.17 with v_3/2 = v_1/2 + h M^-1 f(x_1)).

Velocities are half a substep behind positions. A kick lasts from the time of the old velocity to the middle
of the next substep. Its length is h normally; h / 2 at the start, when velocity and position belong to the
same time; and (h_old + h) / 2 when the substep changes.
"""

from taichi_soft.core.runtime import ti
from taichi_soft.core.types import Integrator
from taichi_soft.solver.integrators.explicit import add_forces, any_shape
from taichi_soft.solver.integrators.integrator_model import IntegratorModel
from taichi_soft.solver.kernels.kick import kick_by_forces


@ti.func
def advance(x, v, a, h, kick):
    """Return the position one substep later and the velocity half a substep after the old position."""
    v_new = v + kick * a
    return x + h * v_new, v_new


@ti.func
def felt_time(lag, h, s):
    """Return the time of a kick [s]. The first kick of a step includes the lag of the velocities."""
    return 0.5 * (lag + h) if s == 0 else h


@ti.func
def drive_time(h, s, substeps):
    """Return the time for which external forces act [s]: h / 2 at both ends of a step, otherwise h."""
    return 0.5 * h if s == 0 or s == substeps else h


LEAPFROG = IntegratorModel(
    Integrator.LEAPFROG,
    felt_time=felt_time,
    drive_time=drive_time,
    hold=add_forces,
    predict=kick_by_forces,
    check=any_shape,
    advance=advance,
    lag=0.5,
    is_lag_told=True,
)
