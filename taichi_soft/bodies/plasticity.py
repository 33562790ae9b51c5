"""Permanent deformation of a body."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass

from taichi_soft.core.checks import as_number, as_positive
from taichi_soft.core.errors import OptionError
from taichi_soft.core.serialisation import serialised

_UNLIMITED = 1e30
"""Number that replaces infinity in kernels, which must not use infinity."""


@serialised("yield_stress", "yield_strain", "creep", "maximum")
@dataclass(frozen=True)
class Plasticity:
    """Permanent deformation of a body that is strained beyond its yield point.

    A tetrahedron deforms plastically, then elastically: F = Fe Fp, where Fp preserves the volume (Irving,
    Teran and Fedkiw 2004). Strain beyond the yield point flows into Fp at the rate `creep`, until Fp reaches
    `maximum` (O'Brien, Bargteil and Hodgins 2002; Mueller and Gross 2004). Plastic flow happens at the end of
    each fixed step, so an impact that begins and ends within one step leaves no dent.

    Args:
        yield_stress: von Mises stress [Pa] below which the deformation is elastic. For every law, the stress
            is computed by Hooke's law from the linear strain.
        yield_strain: yield point as a strain, as in `Body.tet_strain`, instead of `yield_stress`. The two are
            related by yield_stress = 3 G yield_strain, with the shear modulus G.
        creep: rate of flow [1/s]. The excess strain falls to 1/e in a time of 1/creep. Infinity: the excess
            strain flows within one step.
        maximum: largest equivalent logarithmic plastic strain. A tetrahedron can permanently become e^maximum
            times as long. Elongated tetrahedra need shorter substeps, which `World.stable_substeps` does
            not consider.
    Raises: OptionError for a value out of range, or unless exactly one yield point is given.
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
        """Yield stress [Pa], yield strain, creep [1/s] and maximum. A yield point that is None becomes 0."""
        return self.yield_stress or 0.0, self.yield_strain or 0.0, min(self.creep, _UNLIMITED), self.maximum


RIGID_ROW = (0.0, _UNLIMITED, 0.0, 0.0)
"""`Plasticity.row` of a body that never yields."""
