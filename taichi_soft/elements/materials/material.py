"""Material constants in SI units (thesis section 2.3)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.checks import as_count
from taichi_soft.core.errors import MaterialError
from taichi_soft.core.serialisation import serialised
from taichi_soft.elements.materials.element_values import (
    LARGEST,
    POSITIVE,
    Array,
    as_constant,
    as_ratio,
    described,
    is_damping,
    is_positive,
    require_one_length,
    spread,
)

DAMPING_RATIO = 0.05
"""Default damping ratio of a body's slowest vibration. With this value, a tenth of the amplitude remains
after seven oscillations."""

CONSTANTS = ("young", "poisson", "density", "damping", "shear_modulus", "shear_damping")


def isotropic_stiffness(lame_lambda: Array, lame_mu: Array) -> Array:
    """Return stiffness matrices like `Stiffness.matrix`, (m, 6, 6) [Pa], from Lame's constants, (m,) [Pa]."""
    matrices = np.zeros((len(lame_mu), 6, 6))
    matrices[:, :3, :3] = lame_lambda[:, None, None]
    matrices[:, range(6), range(6)] += lame_mu[:, None] * np.array([2.0, 2, 2, 1, 1, 1])
    return matrices


@serialised("young", "poisson", "density", "damping", "shear_modulus", "shear_damping", "damping_ratio")
@dataclass(frozen=True, eq=False)
class Material:
    """An isotropic, linearly elastic, damped material.

    Each constant is a number for the body or an array with one value per tetrahedron.
    Args:
        young: Young's modulus E [Pa], above 0.
        poisson: Poisson's ratio nu, above -1 and below 0.5.
        density: mass per volume [kg/m^3], above 0.
        damping: damping constant b of each edge, thesis eq. 3.9 [N s/m], 0 or more. An edge uses the mean
            over its tetrahedra.
        shear_modulus: shear modulus G [Pa], only for the laws of thesis chapter 4, which allow any value;
            None for E / (2 (1 + nu)).
        damping_ratio: damping ratio of the slowest vibration of a free body. With 0, the body is
            undamped. With 0.05, a tenth of the amplitude remains after seven oscillations. With 1, the body
            returns without oscillating. All vibrations decay at the same rate; rigid motion is not damped.
            The damping ratio never increases the number of substeps. `damping` acts in addition.
        shear_damping: damping b_m across the edges, eq. 4.5 [N s/m], only for the laws of chapter 4; None for
            the value of `damping`.
    Raises: MaterialError with the first value out of range.
    Example:
        rubber = Material(young=1e6, poisson=0.45, density=1100, damping_ratio=0.1)
    """

    young: float | Array
    poisson: float | Array
    density: float | Array
    damping: float | Array = 0.0
    shear_modulus: float | Array | None = None
    shear_damping: float | Array | None = None
    damping_ratio: float = DAMPING_RATIO

    def __repr__(self) -> str:
        return described(self)

    def __post_init__(self) -> None:
        self._check("young", is_positive, f"above 0 Pa, {POSITIVE}")
        self._check("poisson", lambda x: (x > -1) & (x < 0.5), "above -1 and below 0.5 (use 0.49 for rubber)")
        self._check("density", is_positive, f"above 0 kg/m^3, {POSITIVE}")
        self._check("damping", is_damping, f"0 N s/m or more and below {LARGEST:g}")
        if self.shear_modulus is not None:
            self._check("shear_modulus", is_positive, f"above 0 Pa, {POSITIVE}")
        if self.shear_damping is not None:
            self._check("shear_damping", is_damping, f"0 N s/m or more and below {LARGEST:g}")
        object.__setattr__(self, "damping_ratio", as_ratio(self.damping_ratio))
        require_one_length({name: getattr(self, name) for name in CONSTANTS}, "tetrahedron")
        stiffest = float(np.max([np.max(np.abs(self.lame_lambda)), np.max(self.lame_mu)]))
        if stiffest >= LARGEST:
            raise MaterialError(
                f"a Lame parameter of {stiffest:g} Pa overflows: keep poisson away from -1 and 0.5"
            )

    def _check(self, name: str, is_valid: Any, range_text: str) -> None:
        value = as_constant(getattr(self, name), name, "tetrahedron", is_valid, range_text)
        object.__setattr__(self, name, value)

    @property
    def lame_lambda(self) -> float | Array:
        """First Lame parameter E nu / ((1 + nu)(1 - 2 nu)) [Pa]."""
        return self.young * self.poisson / ((1 + self.poisson) * (1 - 2 * self.poisson))

    @property
    def lame_mu(self) -> float | Array:
        """Shear modulus E / (2 (1 + nu)) [Pa]."""
        return self.young / (2 * (1 + self.poisson))

    def per_tet(self, name: str, tet_count: int) -> Array:
        """Return one value of a constant or Lame parameter for each of `tet_count` tetrahedra.

        Args:
            name: "young", "poisson", "density", "damping", "lame_lambda" or "lame_mu".
            tet_count: number of tetrahedra.
        Raises: MaterialError if the constant is an array of another length.
        """
        tet_count = as_count(tet_count, "tet_count", high=2**31 - 1)
        return spread(getattr(self, name), name, "tetrahedra", tet_count)

    def of_tets(self, rows: NDArray[np.int64]) -> Material:
        """Return the material of a subset of the tetrahedra.

        Args:
            rows: indices of the tetrahedra, (k,).
        """
        given = {name: getattr(self, name) for name in CONSTANTS}
        return replace(self, **{name: value[rows] for name, value in given.items() if np.ndim(value) == 1})

    def stiffness_matrices(self, tet_count: int) -> Array:
        """Return the stiffness of each tetrahedron, (m, 6, 6) [Pa], like `Stiffness.matrix`.

        Args:
            tet_count: number of tetrahedra m.
        """
        return isotropic_stiffness(*(self.per_tet(name, tet_count) for name in ("lame_lambda", "lame_mu")))
