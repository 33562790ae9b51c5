"""Compile-time parameters of the kernels that compute forces."""

from dataclasses import dataclass

from taichi_soft.elements.laws import ElementModel


@dataclass(frozen=True)
class Program:
    """Force laws of a world. The compiled code depends on the laws, but not on constants of materials."""

    models: tuple[ElementModel, ...]  # `BodyFields.body_model` is an index into this tuple

    @property
    def reads_expansion(self) -> bool:
        """True if a law of the world uses the expansion of the tetrahedra around an edge."""
        return any(model.reads_expansion for model in self.models)
