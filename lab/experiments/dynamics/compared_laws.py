"""Laws that the experiments on dynamics compare."""

from __future__ import annotations

from lab.experiments.experiment import Effort
from taichi_soft import LAWS

TETRAHEDRAL = ("virial", "face", "st_venant_kirchhoff", "neo_hookean")
"""Laws that compute stress in tetrahedra. All other laws act along edges."""

VARIANTS = ("cmpm2", "best_fitting_plane", "split_ring_plane", "tilted_plane", "tilted_plane_printed")
"""Laws of chapter 4 that need no Voronoi faces."""

WITHOUT_ENERGY = ("volume_springs", "cmpm", *VARIANTS)
"""Laws along edges whose forces do not derive from an energy. Without damping, most bodies become unstable
after several vibrations."""


def laws_of(effort: Effort) -> tuple[str, ...]:
    """List all laws. A quick report omits the variants of CMPM, because they take long to compile."""
    return tuple(law for law in LAWS if effort is Effort.FULL or law not in VARIANTS)
