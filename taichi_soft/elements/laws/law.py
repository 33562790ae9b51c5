"""Force laws: a name, a source, and a function from deformation to forces."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from taichi_soft.core.types import Flips, LawName, Strain
from taichi_soft.elements.laws.bonds import Bonds, Ring
from taichi_soft.elements.laws.rod import Rods
from taichi_soft.elements.laws.shell import Shells

SOLID = ("young", "poisson", "density", "damping")
ANISOTROPIC = ("stiffness", "frame", "density", "damping")


@dataclass(frozen=True)
class StressLaw:
    """Law that converts Hooke's stress in a tetrahedron to forces on its vertices (thesis chapter 6)."""

    name: LawName
    source: str
    summary: str
    forces: Any  # ti.func (shape columns, Cauchy stress columns) -> four vec3 [N]
    strains: tuple[Strain, ...] = (Strain.LINEAR, Strain.EXACT)  # supported strains, the default first
    flips: tuple[Flips, ...] = (Flips.TOLERANT, Flips.RECOVER, Flips.OFF)
    parameters: tuple[str, ...] = SOLID  # constants of the material that the law uses
    keeps_energy: bool = False
    takes_anisotropy: bool = True  # True if the law also supports the parameters `ANISOTROPIC`


@dataclass(frozen=True)
class EnergyLaw:
    """Law whose forces are the derivative of an energy, so that elastic deformation conserves energy."""

    name: LawName
    source: str
    summary: str
    piola: Any  # ti.func (F columns, lambda, mu) -> d energy / d F, columns [Pa]
    principal: Any  # ti.func (stretches vec3, lambda, mu) -> principal stress [Pa], derivatives as columns
    energy_density: Callable[..., Any]  # numpy: F (m, 3, 3), lambda, mu (m,) -> (m,) [J per m^3 at rest]
    strains: tuple[Strain, ...]
    flips: tuple[Flips, ...]  # one entry: the energy determines how inverted tetrahedra are treated
    parameters: tuple[str, ...] = SOLID
    keeps_energy: bool = True
    takes_anisotropy: bool = False


@dataclass(frozen=True)
class BondLaw:
    """Law for forces between the two ends of each edge: the pairwise models of thesis chapters 3 to 5."""

    name: LawName
    source: str
    summary: str
    ring: Ring  # data that the law reads in addition to the two ends
    bonds: Callable[..., Bonds]  # numpy: (mesh, material) -> constants of every edge
    parameters: tuple[str, ...] = (*SOLID, "shear_modulus", "shear_damping")
    keeps_energy: bool = False
    takes_anisotropy: bool = False
    strains: tuple[Strain, ...] = ()
    flips: tuple[Flips, ...] = ()

    @property
    def takes_shear(self) -> bool:
        """True if the law uses the shear modulus and the shear damping of a material."""
        return "shear_modulus" in self.parameters


@dataclass(frozen=True)
class ShellLaw:
    """Law of triangles that resist stretching and bending. A `ShellMaterial` needs it."""

    name: LawName
    source: str
    summary: str
    shells: Callable[..., Shells]  # numpy: (mesh, material) -> constants of every triangle
    parameters: tuple[str, ...] = ("young", "poisson", "density", "thickness", "damping", "bending_damping")
    keeps_energy: bool = True
    takes_anisotropy: bool = False
    strains: tuple[Strain, ...] = ()
    flips: tuple[Flips, ...] = ()


@dataclass(frozen=True)
class RodLaw:
    """Law of edges that resist stretching, and of joints that resist bending and torsion. A `RodMaterial`
    needs it.
    """

    name: LawName
    source: str
    summary: str
    rods: Callable[..., Rods]  # numpy: (mesh, material) -> constants of every edge and joint
    parameters: tuple[str, ...] = (
        "young",
        "poisson",
        "density",
        "radius",
        "inner_radius",
        "damping",
        "bending_damping",
        "torsion_damping",
    )
    keeps_energy: bool = True
    takes_anisotropy: bool = False
    strains: tuple[Strain, ...] = ()
    flips: tuple[Flips, ...] = ()


Law = StressLaw | EnergyLaw | BondLaw | ShellLaw | RodLaw
