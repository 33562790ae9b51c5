"""What a force law is: its name, its source, and one function from deformation to forces."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from taichi_soft.types import Flips, Strain


@dataclass(frozen=True)
class StressLaw:
    """Hooke's stress of a tetrahedron, turned into forces on its vertices (thesis chapter 6)."""

    name: str
    source: str
    summary: str
    forces: Any  # ti.func (shape columns, Cauchy stress columns) -> four vec3 [N]
    strains: tuple[Strain, ...] = (Strain.LINEAR, Strain.EXACT)  # that it takes, its default first
    flips: tuple[Flips, ...] = (Flips.TOLERANT, Flips.RECOVER, Flips.OFF)


@dataclass(frozen=True)
class EnergyLaw:
    """An elastic energy and its derivative: what a body gives back is what was put in."""

    name: str
    source: str
    summary: str
    piola: Any  # ti.func (F columns, lambda, mu) -> d energy / d F, columns [Pa]
    energy_density: Callable[..., Any]  # numpy: F (m, 3, 3), lambda, mu (m,) -> (m,) [J per m^3 at rest]
    strains: tuple[Strain, ...]
    flips: tuple[Flips, ...]  # one: what it does with them follows from the energy


Law = StressLaw | EnergyLaw
