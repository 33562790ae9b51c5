"""Parameters for which a step kernel is compiled."""

from dataclasses import dataclass

from taichi_soft.bodies.law_program import Program
from taichi_soft.solver.integrators import IntegratorModel


@dataclass(frozen=True)
class StepProgram(Program):
    """Structure of a world's step: everything that changes the code of the kernel, but no numbers."""

    integrator: IntegratorModel
    has_floor: bool
    has_contact: bool = False  # contact with colliders, which include the floor
    has_soft_contact: bool = False  # contact between bodies
    has_plasticity: bool = False  # True if a body has plasticity
    worker_count: int = 1  # number of threads that run a flat step together
