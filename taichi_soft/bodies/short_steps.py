"""Warn of meshes that need much shorter substeps than a lattice, because of slivers and small tetrahedra."""

from __future__ import annotations

import logging

import numpy as np

from taichi_soft.bodies.stability import stable_step
from taichi_soft.elements.laws import element_model
from taichi_soft.elements.materials import Material
from taichi_soft.meshing import TetMesh

_log = logging.getLogger(__name__)

LATTICE_STEP = 0.33
"""Stable step of a lattice that fills space, divided by the time cell / sqrt(young / density)."""

WARNING_RATIO = 4.0
"""Largest ratio of a lattice's stable step to the mesh's stable step without a warning. Even a good mesh
has a ratio above 1. For example, a lattice whose outer vertices are moved onto a surface can need steps half
as long."""

RUBBER = Material(young=1e6, poisson=0.3, density=1000.0, damping_ratio=0.0)
"""Material for the comparison of a mesh with a lattice. The choice is arbitrary."""


def warn_of_short_steps(mesh: TetMesh, cell_size: float, method: str) -> None:
    """Log a warning if the stable substeps of a mesh are much shorter than for a lattice.

    Args:
        cell_size: edge of the lattice's cells [m].
        method: method that made the mesh.
    """
    limit = stable_step(mesh, RUBBER, element_model("virial")).limit
    lattice = LATTICE_STEP * cell_size / float(np.sqrt(RUBBER.young / RUBBER.density))
    if lattice > WARNING_RATIO * limit:
        _log.warning(
            "method %r: stable substeps are %.0f times shorter than with a lattice of such cells (%d "
            "tetrahedra, %s): a coarser surface, larger cells or TetMesh.improved() help",
            method,
            lattice / limit,
            len(mesh.tets),
            mesh.quality.summary(),
        )
