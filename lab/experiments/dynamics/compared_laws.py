"""Laws that the experiments on motion compare."""

from __future__ import annotations

from lab.experiments.experiment import Effort
from taichi_soft import LAWS

TETRAHEDRAL = ("virial", "face", "st_venant_kirchhoff", "neo_hookean")
"""Laws that compute stress; the others act along edges."""

VARIANTS = ("cmpm2", "best_fitting_plane", "split_ring_plane", "tilted_plane", "tilted_plane_printed")
"""Laws of chapter 4 without Voronoi faces."""

WITHOUT_ENERGY = ("volume_springs", "cmpm", *VARIANTS)
"""Laws along edges whose forces derive from no energy: most undamped bodies become unstable after several
vibrations."""


def laws_of(effort: Effort) -> tuple[str, ...]:
    """All laws; for a quick report CMPM without its variants, because each of them compiles for long."""
    return tuple(law for law in LAWS if effort is Effort.FULL or law not in VARIANTS)
