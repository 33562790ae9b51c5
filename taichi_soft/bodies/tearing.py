"""Tearing of bodies."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass

from taichi_soft.core.checks import as_count, as_positive
from taichi_soft.core.serialisation import serialised


@serialised("stress", "most")
@dataclass(frozen=True)
class Tearing:
    """Tearing of a body that is pulled beyond its strength (O'Brien and Hodgins 1999).

    After each step, the face between two tetrahedra tears if the largest principal stress of the mean of
    their two stresses exceeds the strength. The vertices of the face are then split along faces of the
    tetrahedra around them, perpendicular to the direction of that principal stress. The stress is the Cauchy
    stress of the body's force law: see `Body.tet_stress`. A body tears until its `spare_vertices` are used
    up. Detached pieces become bodies, the largest first, while slots are free. Other pieces, and fragments of
    less than 2 % of the body, remain separate parts of the body. Vertices attached to a frame, and their
    copies, stay attached. A body that is grabbed, joined to another body or driven by a motor does not tear.

    Args:
        stress: tensile strength [Pa].
        most: largest number of faces that tear per step in one body. It limits the speed of tears.
    Raises: OptionError for a value out of range.
    """

    stress: float
    _: KW_ONLY
    most: int = 4

    def __post_init__(self) -> None:
        as_positive(self.stress, "stress", "Pa")
        as_count(self.most, "most", 1, 1000)
