"""Material constants in SI units (thesis section 2.3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.checks import as_count
from taichi_soft.errors import MaterialError

Array = NDArray[np.float64]

SMALLEST, LARGEST = 1e-9, 1e20
"""Constants beyond overflow float32 on their way to a force or an acceleration."""


@dataclass(frozen=True, eq=False)
class Material:
    """An isotropic, linearly elastic, damped material.

    Each constant is a number for the whole body or an array with one value per tetrahedron.
    Args:
        young: Young's modulus E [Pa], above 0.
        poisson: Poisson's ratio nu, above -1 and below 0.5.
        density: mass per volume [kg/m^3], above 0.
        damping: b of thesis eq. 3.9 [N s/m], one per edge, 0 or more. An array is averaged over the
            tetrahedra that share an edge.
    Raises: MaterialError with the first value out of range.
    """

    young: float | Array
    poisson: float | Array
    density: float | Array
    damping: float | Array = 0.0

    def __post_init__(self) -> None:
        self._check(
            "young",
            lambda x: (x >= SMALLEST) & (x < LARGEST),
            f"above 0 Pa, from {SMALLEST:g} to {LARGEST:g}",
        )
        self._check(
            "poisson",
            lambda x: (x > -1) & (x < 0.5),
            "above -1 and below 0.5 (use 0.49 for rubber)",
        )
        self._check(
            "density",
            lambda x: (x >= SMALLEST) & (x < LARGEST),
            f"above 0 kg/m^3, from {SMALLEST:g} to {LARGEST:g}",
        )
        self._check("damping", lambda x: (x >= 0) & (x < LARGEST), f"0 N s/m or more and below {LARGEST:g}")
        lengths = {
            name: value.size
            for name in ("young", "poisson", "density", "damping")
            if isinstance(value := getattr(self, name), np.ndarray)
        }
        if len(set(lengths.values())) > 1:
            raise MaterialError(
                f"arrays of different lengths {lengths}: give one value per tetrahedron in each"
            )
        stiffest = float(np.max([np.max(np.abs(self.lame_lambda)), np.max(self.lame_mu)]))
        if stiffest >= LARGEST:
            raise MaterialError(
                f"a Lame parameter of {stiffest:g} Pa overflows: keep poisson away from -1 and 0.5"
            )

    def _check(self, name: str, is_valid: Any, range_text: str) -> None:
        given = getattr(self, name)
        try:
            if np.asarray(given).dtype.kind not in "iuf":
                raise TypeError
            values = np.array(given, dtype=np.float64)
        except (TypeError, ValueError):
            raise MaterialError(
                f"{name} must be a number or one number per tetrahedron, got {given!r}"
            ) from None
        if values.ndim > 1 or values.size == 0:
            raise MaterialError(
                f"{name} must be a number or a flat array, got an array of shape {values.shape}"
            )
        bad = ~(np.isfinite(values) & is_valid(values))
        if bad.any():
            first = int(np.flatnonzero(bad)[0])
            where = "" if values.ndim == 0 else f" of tetrahedron {first}"
            raise MaterialError(f"{name}{where} is {values.reshape(-1)[first]:g}: it must be {range_text}")
        values.flags.writeable = False
        object.__setattr__(self, name, float(values) if values.ndim == 0 else values)

    @property
    def lame_lambda(self) -> float | Array:
        """First Lame parameter E nu / ((1 + nu)(1 - 2 nu)) [Pa]."""
        return self.young * self.poisson / ((1 + self.poisson) * (1 - 2 * self.poisson))

    @property
    def lame_mu(self) -> float | Array:
        """Shear modulus E / (2 (1 + nu)) [Pa]."""
        return self.young / (2 * (1 + self.poisson))

    def per_tet(self, name: str, tet_count: int) -> Array:
        """One value of a constant or Lame parameter for each of `tet_count` tetrahedra.

        Raises: MaterialError if the constant is an array of another length.
        """
        tet_count = as_count(tet_count, "tet_count", high=2**31 - 1)
        values = np.asarray(getattr(self, name), dtype=np.float64)
        if values.ndim == 1 and values.shape[0] != tet_count:
            raise MaterialError(
                f"{name} has {values.shape[0]} values for a mesh of {tet_count} tetrahedra: give one each"
            )
        return np.ascontiguousarray(np.broadcast_to(values, (tet_count,)))


def require_material(value: ArrayLike | Material) -> Material:
    """`value` if it is a Material. Raises: MaterialError otherwise."""
    if not isinstance(value, Material):
        raise MaterialError(f"material must be a taichi_soft.Material, got {type(value).__name__}")
    return value
