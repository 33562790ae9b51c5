"""How forces become motion. A new integrator is one file and one line here."""

from taichi_soft.core.types import Integrator
from taichi_soft.solver.integrators.explicit_euler import explicit_euler
from taichi_soft.solver.integrators.lazy_leapfrog import lazy_leapfrog
from taichi_soft.solver.integrators.leapfrog import leapfrog

__all__ = ["ADVANCE"]

ADVANCE = {  # implicit Euler moves a whole body at once and so is a kernel: `solver.kernels.implicit_euler`
    Integrator.EXPLICIT_EULER: explicit_euler,
    Integrator.LEAPFROG: leapfrog,
    Integrator.LAZY_LEAPFROG: lazy_leapfrog,
}
