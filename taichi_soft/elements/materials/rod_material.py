"""Constants of rods: cables, hoses, wires, coil springs."""

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

CONSTANTS = (
    "young",
    "poisson",
    "density",
    "radius",
    "inner_radius",
    "damping",
    "bending_damping",
    "torsion_damping",
)


@serialised(*CONSTANTS)
@dataclass(frozen=True, eq=False)
class RodMaterial:
    """An isotropic, elastic material of a `RodMesh` with a circular section.

    Each constant is a number, or an array with one number per edge. With the area A and the second moment of
    area I of the section, stretching has the stiffness E A, bending E I, and torsion G J, where
    G = E / (2 (1 + nu)) and J = 2 I.

    Args:
        young: Young's modulus E [Pa], above 0.
        poisson: Poisson's ratio nu, above -1 and at most 0.5.
        density: mass per volume of the material [kg/m^3], above 0.
        radius: outer radius of the section [m], above 0. Twice this radius is the default thickness in
            contact with other bodies, half of it on each side.
        inner_radius: radius of the hollow of a hose [m], from 0 to below `radius`; 0 for a solid section.
        damping: damping constant b of each edge, thesis eq. 3.9 [N s/m], 0 or more. It damps stretching, but
            not bending.
        bending_damping: viscosity of bending, as a time [s], 0 or more. A bending vibration of the angular
            frequency w has the damping ratio w * bending_damping / 2. Rotation is not damped.
        torsion_damping: the same for torsion [s]. Torsion is fast, so values above half of the time in
            which sound crosses an edge need more substeps.
    Raises: MaterialError with the first value out of range.
    Example:
        garden_hose = RodMaterial(
            young=5e6, poisson=0.45, density=1100, radius=0.012, inner_radius=0.009, bending_damping=4e-3
        )
    """

    young: float | Array
    poisson: float | Array
    density: float | Array
    radius: float | Array
    inner_radius: float | Array = 0.0
    damping: float | Array = 0.0
    bending_damping: float | Array = 0.0
    torsion_damping: float | Array = 0.0

    def __repr__(self) -> str:
        return described(self)

    def __post_init__(self) -> None:
        self._check("young", is_positive, f"above 0 Pa, {POSITIVE}")
        self._check("poisson", lambda x: (x > -1) & (x <= 0.5), "above -1 and at most 0.5")
        self._check("density", is_positive, f"above 0 kg/m^3, {POSITIVE}")
        self._check("radius", is_positive, f"above 0 m, {POSITIVE}")
        self._check("inner_radius", is_damping, "0 m or more, and below radius")
        self._check("damping", is_damping, f"0 N s/m or more and below {LARGEST:g}")
        self._check("bending_damping", is_damping, f"0 s or more and below {LARGEST:g}")
        self._check("torsion_damping", is_damping, f"0 s or more and below {LARGEST:g}")
        require_one_length({name: getattr(self, name) for name in CONSTANTS}, "edge")
        thinnest = np.asarray(self.radius - np.asarray(self.inner_radius))
        if not (thinnest > 1e-3 * np.asarray(self.radius)).all():
            raise MaterialError(
                f"inner_radius={np.max(self.inner_radius):g} m leaves no wall: keep it below 99.9 % of "
                f"radius={np.min(self.radius):g} m"
            )
        stiffest = float(np.max(self.young / (1 + np.asarray(self.poisson))))
        if stiffest >= LARGEST:
            raise MaterialError(f"a modulus of {stiffest:g} Pa overflows: keep poisson away from -1")

    def _check(self, name: str, is_valid: Any, range_text: str) -> None:
        value = as_constant(getattr(self, name), name, "edge", is_valid, range_text)
        object.__setattr__(self, name, value)

    def per_edge(self, name: str, edge_count: int) -> Array:
        """Return one value of a constant for each of `edge_count` edges.

        Args:
            name: name of the constant, such as "young".
            edge_count: number of edges.
        Raises: MaterialError if the constant is an array of another length.
        """
        return spread(getattr(self, name), name, "edges", edge_count)
