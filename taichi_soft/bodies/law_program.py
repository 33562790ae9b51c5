"""Parameters that kernels for one body are compiled for."""

from dataclasses import dataclass

from taichi_soft.elements.laws import ElementModel


@dataclass(frozen=True)
class Program:
    """The laws of a world: everything that shapes the code, and no numbers."""

    models: tuple[ElementModel, ...]  # each body refers to one by its index

    @property
    def reads_expansion(self) -> bool:
        """True if edges of any body read the expansion of their tetrahedra."""
        return any(model.reads_expansion for model in self.models)
