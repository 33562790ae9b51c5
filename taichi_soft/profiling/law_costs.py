"""Measure the cost of each force law, alternating with the thesis's virial law."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial

from taichi_soft.core.types import LawName, StrainName
from taichi_soft.elements.laws import LAWS, BondLaw, Law, element_model
from taichi_soft.elements.materials import AnisotropicMaterial, Material, Stiffness
from taichi_soft.meshing import box
from taichi_soft.profiling.spread import Spread, compare
from taichi_soft.world.bare import bare_world

MESH = box((1.0, 1.0, 1.0), (10, 10, 10))
TETS, EDGES = len(MESH.tets), len(MESH.edges)
MATERIAL = Material(young=1.0e5, poisson=0.3, density=1000.0, damping=0.1, damping_ratio=0.0)
WOODEN = AnisotropicMaterial(Stiffness.isotropic(1.0e5, 0.3), density=1000.0, damping=0.1)
SUBSTEPS = 40
SUBSTEP = 1.0e-5  # length of a substep [s], far below the stable limit


@dataclass(frozen=True)
class LawCost:
    """Cost of a law with one strain and one kind of material. `strain` is None if the law has only
    one strain.
    """

    law: LawName
    strain: StrainName | None
    is_anisotropic: bool
    element: str  # "tetrahedron" or "edge"
    cost: Spread  # time of a substep, including edge damping [ns per element]
    ratio: Spread  # cost divided by the cost of "virial" with the linear strain, in alternating runs


def kinds_of(laws: Iterable[Law]) -> list[tuple[Law, StrainName | None, bool]]:
    """Return the combinations to measure, as (law, strain, True if the material is anisotropic).

    The strain is None if the law offers no choice. Anisotropic material is combined with the default strain.
    """
    found: list[tuple[Law, StrainName | None, bool]] = []
    for law in laws:
        strains: list[StrainName | None] = [strain.value for strain in law.strains] or [None]
        found += [(law, strain, False) for strain in strains]
        found += [(law, strains[0], True)] * law.takes_anisotropy
    return found


def measure_laws(names: Sequence[LawName] = tuple(LAWS), repeats: int = 11) -> list[LawCost]:
    """Measure the laws in `names` with every strain and material, on one body and thus one thread.

    Raises: OptionError for an unknown name.
    """
    laws = [element_model(name).law for name in names]
    usual = _falling("virial", None, MATERIAL)
    found = []
    for law, strain, is_anisotropic in kinds_of(laws):
        element, count = ("edge", EDGES) if isinstance(law, BondLaw) else ("tetrahedron", TETS)
        moving = _falling(law.name, strain, WOODEN if is_anisotropic else MATERIAL)
        cost, _, ratio = compare(moving, usual, repeats, 1e9 / SUBSTEPS / count)
        found.append(LawCost(law.name, strain, is_anisotropic, element, cost, ratio))
    return found


def _falling(
    law: LawName, strain: StrainName | None, material: Material | AnisotropicMaterial
) -> partial[None]:
    world = bare_world(floor=None, schedule="per_body")
    world.add_body(MESH, material, law=law, strain=strain)
    world.build()
    return partial(world.step, SUBSTEPS * SUBSTEP, SUBSTEPS)
