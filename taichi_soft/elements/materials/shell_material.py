"""Constants of shells: cloth, paper, sheet metal, thin walls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from taichi_soft.core.errors import MaterialError
from taichi_soft.core.serialisation import serialised
from taichi_soft.elements.materials.element_values import (
    LARGEST,
    POSITIVE,
    Array,
    as_constant,
    described,
    is_damping,
    is_positive,
    require_one_length,
    spread,
)

CONSTANTS = ("young", "poisson", "density", "thickness", "damping", "bending_damping")


@serialised(*CONSTANTS)
@dataclass(frozen=True, eq=False)
class ShellMaterial:
    """An isotropic, elastic material of a `ShellMesh`.

    Each constant is a number, or an array with one number per triangle. The membrane has the stiffness
    `young * thickness`. Bending has the stiffness `young * thickness^3 / (12 (1 - poisson^2))`.

    Args:
        young: Young's modulus E [Pa], above 0.
        poisson: Poisson's ratio nu, above -1 and at most 0.5.
        density: mass per volume [kg/m^3], above 0.
        thickness: thickness t [m], above 0. It is also the default thickness in contact with other bodies,
            half of it on each side.
        damping: damping constant b of each edge, thesis eq. 3.9 [N s/m], 0 or more. An edge uses the mean
            over its triangles. It damps stretching, but not bending.
        bending_damping: viscosity of bending, as a time [s], 0 or more. A bending vibration of the angular
            frequency w has the damping ratio w * bending_damping / 2. Stretching and rotation are not damped.
    Raises: MaterialError with the first value out of range.
    Example:
        linen = ShellMaterial(young=5e6, poisson=0.3, density=500, thickness=5e-4, bending_damping=2e-3)
    """

    young: float | Array
    poisson: float | Array
    density: float | Array
    thickness: float | Array
    damping: float | Array = 0.0
    bending_damping: float | Array = 0.0

    def __repr__(self) -> str:
        return described(self)

    def __post_init__(self) -> None:
        self._check("young", is_positive, f"above 0 Pa, {POSITIVE}")
        self._check("poisson", lambda x: (x > -1) & (x <= 0.5), "above -1 and at most 0.5")
        self._check("density", is_positive, f"above 0 kg/m^3, {POSITIVE}")
        self._check("thickness", is_positive, f"above 0 m, {POSITIVE}")
        self._check("damping", is_damping, f"0 N s/m or more and below {LARGEST:g}")
        self._check("bending_damping", is_damping, f"0 s or more and below {LARGEST:g}")
        require_one_length({name: getattr(self, name) for name in CONSTANTS}, "triangle")
        stiffest = float(np.max(self.young / (1 - np.square(self.poisson))))
        if stiffest >= LARGEST:
            raise MaterialError(f"a modulus of {stiffest:g} Pa overflows: keep poisson away from -1")

    def _check(self, name: str, is_valid: Any, range_text: str) -> None:
        value = as_constant(getattr(self, name), name, "triangle", is_valid, range_text)
        object.__setattr__(self, name, value)

    def per_triangle(self, name: str, triangle_count: int) -> Array:
        """Return one value of a constant for each of `triangle_count` triangles.

        Args:
            name: name of the constant, such as "young".
            triangle_count: number of triangles.
        Raises: MaterialError if the constant is an array of another length.
        """
        return spread(getattr(self, name), name, "triangles", triangle_count)
