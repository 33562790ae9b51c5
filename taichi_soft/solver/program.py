"""Parameters for which a step kernel is compiled."""

from dataclasses import dataclass

from taichi_soft.bodies.law_program import Program
from taichi_soft.solver.integrators import IntegratorModel


@dataclass(frozen=True)
class StepProgram(Program):
    """Options of a world that change the code of its step kernel. Numbers such as gravity do not."""

    integrator: IntegratorModel
    has_floor: bool
    has_contact: bool = False  # True if bodies can touch colliders or the floor
    has_soft_contact: bool = False  # True if bodies can touch each other
    has_plasticity: bool = False  # True if a body has plasticity
    worker_count: int = 1  # number of threads that run a flat step together
