"""The parameters that a step kernel is compiled for."""

from dataclasses import dataclass

from taichi_soft.bodies.law_program import Program
from taichi_soft.solver.integrators import IntegratorModel


@dataclass(frozen=True)
class StepProgram(Program):
    """Structure of a world's step: everything that changes the code, but no numbers."""

    integrator: IntegratorModel
    has_floor: bool
    has_contact: bool = False  # with colliders; the floor is one of them
    has_soft_contact: bool = False  # between bodies
    has_plasticity: bool = False  # at least one body has it
    worker_count: int = 1  # threads that share one flat step
