"""Tearing of bodies."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass

from taichi_soft.core.checks import as_count, as_positive
from taichi_soft.core.serialisation import serialised


@serialised("stress", "most")
@dataclass(frozen=True)
class Tearing:
    """Tearing where the material is pulled beyond its strength (O'Brien and Hodgins 1999).

    After each step, the face between two tetrahedra tears if the largest principal stress of their mean
    exceeds the strength: its vertices are split perpendicular to the pull, along the faces of the tetrahedra
    around them. The stress is the Cauchy stress of the body's own law: see `Body.tet_stress`. A body tears as
    long as its `spare_vertices` last. Pieces that fall off become bodies while slots are free, the largest
    first. The others, and fragments of less than 2 % of the body, remain in it as separate parts. Frames keep
    holding their vertices and copies of these. A body that is grabbed, joined to another one or driven by a
    motor does not tear.

    Args:
        stress: tensile strength [Pa].
        most: largest number of faces that one step tears in one body: the speed of a tear.
    Raises: OptionError for a value out of range.
    """

    stress: float
    _: KW_ONLY
    most: int = 4

    def __post_init__(self) -> None:
        as_positive(self.stress, "stress", "Pa")
        as_count(self.most, "most", 1, 1000)
