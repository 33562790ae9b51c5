"""What a step kernel is compiled for."""

from dataclasses import dataclass
from typing import Any

from taichi_soft.integrators import ADVANCE
from taichi_soft.laws import ElementModel
from taichi_soft.types import Integrator


@dataclass(frozen=True)
class Program:
    """Structure of a world's step: everything that shapes the code, and no number."""

    models: tuple[ElementModel, ...]  # a body names one by its index
    integrator: Integrator
    has_floor: bool
    has_contact: bool = False  # with colliders, of which the floor then is one
    has_soft_contact: bool = False  # bodies with each other
    has_plasticity: bool = False  # of any body
    worker_count: int = 1  # threads that share one flat step

    @property
    def advance(self) -> Any:
        """The integrator's ti.func (x, v, a, h, kick) -> (x, v)."""
        return ADVANCE[self.integrator]

    @property
    def reads_expansion(self) -> bool:
        """Whether edges of any body look at how their tetrahedra have grown."""
        return any(model.reads_expansion for model in self.models)
