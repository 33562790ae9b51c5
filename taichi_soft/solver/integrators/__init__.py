"""Integrators of a step.

To add an integrator that evaluates forces once per substep, write its file, add one line here, and add its
name to `core.types`.
"""

from taichi_soft.solver.integrators.explicit_euler import EXPLICIT_EULER
from taichi_soft.solver.integrators.implicit_euler import IMPLICIT_EULER
from taichi_soft.solver.integrators.integrator_model import IntegratorModel
from taichi_soft.solver.integrators.lazy_leapfrog import LAZY_LEAPFROG
from taichi_soft.solver.integrators.leapfrog import LEAPFROG

__all__ = ["INTEGRATORS", "IntegratorModel"]

INTEGRATORS = {model.name: model for model in (EXPLICIT_EULER, LEAPFROG, LAZY_LEAPFROG, IMPLICIT_EULER)}
