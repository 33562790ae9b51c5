"""What each force law costs, in turns with the thesis's."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from taichi_soft.laws import LAWS, BondLaw
from taichi_soft.materials import Material
from taichi_soft.meshing import box
from taichi_soft.profiling.spread import Spread, compare
from taichi_soft.world import World

MESH = box((1.0, 1.0, 1.0), (10, 10, 10))
TETS, EDGES = len(MESH.tets), len(MESH.edges)
MATERIAL = Material(young=1.0e5, poisson=0.3, density=1000.0, damping=0.1)
SUBSTEPS = 40
SUBSTEP = 1.0e-5  # [s], far below every limit: the bodies just fall


@dataclass(frozen=True)
class LawCost:
    """A law with one of the strains it takes, None where it has none to choose."""

    law: str
    strain: str | None
    element: str  # that it works on: "tetrahedron" or "edge"
    cost: Spread  # of a whole substep, edge damping included [ns per element]
    ratio: Spread  # over that of "virial" with the linear strain, pair by pair


def measure_laws(repeats: int = 11) -> list[LawCost]:
    """Measure every law with every strain, on one body and so on one thread."""
    usual = _falling("virial", None)
    found = []
    for law in LAWS.values():
        for strain in law.strains or (None,):
            name = None if strain is None else strain.value
            element, count = ("edge", EDGES) if isinstance(law, BondLaw) else ("tetrahedron", TETS)
            cost, _, ratio = compare(_falling(law.name, name), usual, repeats, 1e9 / SUBSTEPS / count)
            found.append(LawCost(law.name, name, element, cost, ratio))
    return found


def _falling(law: str, strain: str | None) -> partial[None]:
    world = World(floor=None, schedule="per_body")
    world.add_body(MESH, MATERIAL, law=law, strain=strain)
    world.build()
    return partial(world.step, SUBSTEPS * SUBSTEP, SUBSTEPS)
