"""Laws and their strains, by the names that points of experiments use."""

from __future__ import annotations

from lab.experiments.experiment import Effort, Point
from taichi_soft import LAWS
from taichi_soft.core.types import LawName, Strain
from taichi_soft.elements.laws import BondLaw


def variants(effort: Effort) -> list[Point]:
    """{"law": name, "strain": name or None}, those on tetrahedra first. A quick report omits the exact strain
    by faces, whose forces are those of the virial theorem.
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
    """Label for rows of tables."""
    return str(point["law"]) + (f", {point['strain']} strain" if point["strain"] else "")
