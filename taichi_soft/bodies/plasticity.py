"""Permanent deformation of a body."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass

from taichi_soft.core.checks import as_number, as_positive
from taichi_soft.core.errors import OptionError
from taichi_soft.core.serialisation import serialised

_UNLIMITED = 1e30
"""Finite stand-in for no limit, so that kernels need no infinity."""


@serialised("yield_stress", "yield_strain", "creep", "maximum")
@dataclass(frozen=True)
class Plasticity:
    """Permanent change of the rest shape where a body is strained beyond its yield point.

    The deformation of a tetrahedron is a plastic one followed by an elastic one, F = Fe Fp, and Fp preserves
    the volume (Irving, Teran and Fedkiw 2004). Yield point, creep and maximum are those of O'Brien, Bargteil
    and Hodgins 2002 and of Mueller and Gross 2004: strain beyond the yield point flows into Fp at the rate
    `creep`, until Fp reaches `maximum`. It flows at the end of each fixed step, so an impact that is over
    within one step leaves no dent.

    Args:
        yield_stress: von Mises stress [Pa] by Hooke's law and linear strain, for every law, below which the
            deformation is elastic.
        yield_strain: the same as a strain, as in `Body.tet_strain`; pass one of the two. They are related by
            yield_stress = 3 G yield_strain, with the shear modulus G.
        creep: rate of flow [1/s]: within 1/creep the excess falls to 1/e. Infinity: within a step.
        maximum: largest plastic strain, logarithmic and equivalent: a tetrahedron can become e^maximum times
            as long permanently. Long ones need shorter substeps, which `World.stable_substeps` does not
            consider.
    Raises: OptionError for a value out of range, or for none or both of the yield points.
    """

    _: KW_ONLY
    yield_stress: float | None = None
    yield_strain: float | None = None
    creep: float = math.inf
    maximum: float = 1.0

    def __post_init__(self) -> None:
        if (self.yield_stress is None) == (self.yield_strain is None):
            raise OptionError(
                f"pass either yield_stress [Pa] or yield_strain: got {self.yield_stress!r} and "
                f"{self.yield_strain!r}"
            )
        if self.yield_stress is not None:
            as_positive(self.yield_stress, "yield_stress", "Pa")
        if self.yield_strain is not None:
            as_positive(self.yield_strain, "yield_strain", "")
        if not (isinstance(self.creep, float) and self.creep == math.inf):
            as_positive(self.creep, "creep", "1/s, or infinity")
        as_number(self.maximum, "maximum", 0.0, 10.0)

    @property
    def row(self) -> tuple[float, float, float, float]:
        """Yield stress [Pa] and yield strain, of which one is zero, creep [1/s] and maximum."""
        return self.yield_stress or 0.0, self.yield_strain or 0.0, min(self.creep, _UNLIMITED), self.maximum


RIGID_ROW = (0.0, _UNLIMITED, 0.0, 0.0)
"""`Plasticity.row` of a body that never yields."""
