"""Laws and their strains, as points of experiments name them."""

from __future__ import annotations

from lab.experiments.experiment import Effort, Point
from taichi_soft import LAWS
from taichi_soft.core.types import LawName, Strain
from taichi_soft.elements.laws import BondLaw


def variants(effort: Effort) -> list[Point]:
    """List the laws as {"law": name, "strain": name or None}, laws on tetrahedra first.

    A quick report omits the law "face" with the exact strain, because its forces equal those of the virial
    law.
    """
    every = [
        {"law": law.name, "strain": strain and strain.value}
        for law in LAWS.values()
        for strain in (law.strains if len(law.strains) > 1 else (None,))
    ]
    if effort is Effort.QUICK:
        every.remove({"law": "face", "strain": Strain.EXACT.value})
    return every


def is_tetrahedral(law: LawName) -> bool:
    """True if the law computes forces from the stress of tetrahedra; other laws act along edges."""
    return not isinstance(LAWS[law], BondLaw)


def label(point: Point) -> str:
    """Return the label of a point for tables."""
    return str(point["law"]) + (f", {point['strain']} strain" if point["strain"] else "")
