"""What a step kernel is compiled for."""

from dataclasses import dataclass

from taichi_soft.bodies.law_program import Program
from taichi_soft.solver.integrators import IntegratorModel


@dataclass(frozen=True)
class StepProgram(Program):
    """Structure of a world's step: everything that shapes the code, and no number."""

    integrator: IntegratorModel
    has_floor: bool
    has_contact: bool = False  # with colliders, of which the floor then is one
    has_soft_contact: bool = False  # bodies with each other
    has_plasticity: bool = False  # of any body
    worker_count: int = 1  # threads that share one flat step
