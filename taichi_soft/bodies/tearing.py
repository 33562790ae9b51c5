"""How bodies of an asset tear."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass

from taichi_soft.core.checks import as_count, as_positive
from taichi_soft.core.serialisation import serialised


@serialised("stress", "most")
@dataclass(frozen=True)
class Tearing:
    """Tear vertices in two where the material is pulled beyond its strength (O'Brien and Hodgins 1999).

    Looked for after each step. The face between two tetrahedra tears where the largest principal stress of
    their mean is above the strength: its vertices are split across the pull, along the faces of the
    tetrahedra round them. It is the Cauchy stress of the body's own law: see `Body.tet_stress`. A body tears
    as long as its `spare_vertices` last; what falls off becomes a body while slots are free, the largest
    first; the rest, and crumbs of less than 2 % of the whole, stay loose in the body. What a frame holds it
    goes on holding, copies of it as well; while a body is grabbed, joined to another one or driven by a
    motor, it does not tear.

    Args:
        stress: tensile strength [Pa].
        most: faces that one step may tear in one body: how fast a tear runs.
    Raises: OptionError for a value out of range.
    """

    stress: float
    _: KW_ONLY
    most: int = 4

    def __post_init__(self) -> None:
        as_positive(self.stress, "stress", "Pa")
        as_count(self.most, "most", 1, 1000)
