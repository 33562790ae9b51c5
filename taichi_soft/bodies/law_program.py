"""What kernels that look at one body are compiled for."""

from dataclasses import dataclass

from taichi_soft.elements.laws import ElementModel


@dataclass(frozen=True)
class Program:
    """Which laws there are: what shapes the code, and no number."""

    models: tuple[ElementModel, ...]  # a body names one by its index

    @property
    def reads_expansion(self) -> bool:
        """Whether edges of any body look at how their tetrahedra have grown."""
        return any(model.reads_expansion for model in self.models)
