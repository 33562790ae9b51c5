"""Every law with every strain that it takes, as points of experiments name them."""

from __future__ import annotations

from taichi_soft import LAWS
from taichi_soft.experiments.experiment import Point
from taichi_soft.laws import BondLaw


def variants() -> list[Point]:
    """{"law": name, "strain": name or None}, those on tetrahedra first."""
    return [
        {"law": law.name, "strain": strain and strain.value}
        for law in LAWS.values()
        for strain in (law.strains if len(law.strains) > 1 else (None,))
    ]


def is_tetrahedral(law: str) -> bool:
    """Whether it turns the stress of tetrahedra into forces; others act along edges."""
    return not isinstance(LAWS[law], BondLaw)


def label(point: Point) -> str:
    """For rows of tables."""
    return str(point["law"]) + (f", {point['strain']} strain" if point["strain"] else "")
