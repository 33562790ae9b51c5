"""Material of rigid bodies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from taichi_soft.core.serialisation import serialised
from taichi_soft.elements.materials.element_values import POSITIVE, Array, as_constant, is_positive


@serialised("density")
@dataclass(frozen=True)
class RigidMaterial:
    """Material of a rigid body: it has mass, and nothing deforms it.

    Args:
        density: mass per volume [kg/m^3], above 0.
    Raises: MaterialError for a density out of range.
    """

    density: float
    damping_ratio: ClassVar[float] = 0.0

    def __post_init__(self) -> None:
        density = as_constant(
            self.density, "density", "tetrahedron", is_positive, f"above 0 kg/m^3, {POSITIVE}"
        )
        object.__setattr__(self, "density", float(np.asarray(density)))

    def per_tet(self, name: str, tet_count: int) -> Array:
        """Return a constant of each tetrahedron, (m,). All constants but the density are 0.

        Args:
            name: name of the constant.
            tet_count: number of tetrahedra, m.
        """
        return np.full(tet_count, self.density if name == "density" else 0.0)
