"""Which laws are compared, and what they need to move for some time."""

from __future__ import annotations

from lab.experiments.experiment import Effort
from taichi_soft import LAWS

TETRAHEDRAL = ("virial", "face", "st_venant_kirchhoff", "neo_hookean")
"""Laws that know stress; the others act along edges."""

WITHOUT_ENERGY = (
    *("volume_springs", "cmpm", "cmpm2", "best_fitting_plane", "tilted_plane", "tilted_plane_printed"),
)
"""Laws along edges that belong to no energy: undamped, most bodies run away after some vibrations."""


def laws_of(effort: Effort) -> tuple[str, ...]:
    """All; where it must be quick, one of those of chapter 4, which compile for long."""
    chapter_4 = ("cmpm2", "best_fitting_plane", "tilted_plane", "tilted_plane_printed")
    return tuple(law for law in LAWS if effort is Effort.FULL or law not in chapter_4)
