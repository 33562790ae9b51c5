"""Compile-time parameters of the kernels for one body."""

from dataclasses import dataclass

from taichi_soft.elements.laws import ElementModel


@dataclass(frozen=True)
class Program:
    """The laws of a world: choices that shape the compiled code, without numbers."""

    models: tuple[ElementModel, ...]  # each body refers to one by its index

    @property
    def reads_expansion(self) -> bool:
        """True if edges of any body read the expansion of their tetrahedra."""
        return any(model.reads_expansion for model in self.models)
