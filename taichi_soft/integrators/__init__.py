"""How forces become motion. A new integrator is one file and one line here."""

from taichi_soft.integrators.explicit_euler import explicit_euler
from taichi_soft.integrators.lazy_leapfrog import lazy_leapfrog
from taichi_soft.integrators.leapfrog import leapfrog
from taichi_soft.integrators.stability import StableStep, stable_step
from taichi_soft.types import Integrator

__all__ = ["ADVANCE", "StableStep", "stable_step"]

ADVANCE = {
    Integrator.EXPLICIT_EULER: explicit_euler,
    Integrator.LEAPFROG: leapfrog,
    Integrator.LAZY_LEAPFROG: lazy_leapfrog,
}
