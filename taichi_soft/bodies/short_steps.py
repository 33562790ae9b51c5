"""Substeps that slivers and small tetrahedra make short, beside those of a lattice."""

from __future__ import annotations

import logging

import numpy as np

from taichi_soft.bodies.stability import stable_step
from taichi_soft.elements.laws import element_model
from taichi_soft.elements.materials import Material
from taichi_soft.meshing import TetMesh

_log = logging.getLogger(__name__)

LATTICE_STEP = 0.33
"""Stable step of a lattice that fills space, over the time that sqrt(young / density) takes for a cell."""

MOST_SHORTER = 4.0
"""Than that: where its outer vertices are moved onto a surface, a lattice's own is up to twice as short."""

RUBBER = Material(young=1e6, poisson=0.3, density=1000.0, damping_ratio=0.0)
"""By which meshes are compared; which it is, is no matter."""


def warn_of_short_steps(mesh: TetMesh, cell_size: float, method: str) -> None:
    """Log how much shorter the stable substeps of a mesh are than those of a lattice, where that is much.

    Args:
        cell_size: of the lattice [m].
        method: that made the mesh.
    """
    limit = stable_step(mesh, RUBBER, element_model("virial")).limit
    lattice = LATTICE_STEP * cell_size / float(np.sqrt(RUBBER.young / RUBBER.density))
    if lattice > MOST_SHORTER * limit:
        _log.warning(
            "method %r: stable substeps are %.0f times shorter than with a lattice of such cells (%d "
            "tetrahedra, %s): a coarser surface, larger cells or TetMesh.improved() help",
            method,
            lattice / limit,
            len(mesh.tets),
            mesh.quality.summary(),
        )
