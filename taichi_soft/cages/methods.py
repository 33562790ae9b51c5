"""The ways from a surface to tetrahedra."""

from __future__ import annotations

from typing import get_args

import numpy as np

from taichi_soft.cages.cage import lattice_cage
from taichi_soft.cages.cell_size import cell_size_of
from taichi_soft.cages.mesher import TIME_LIMIT, mesher_mesh
from taichi_soft.core.checks import as_positive
from taichi_soft.core.errors import OptionError
from taichi_soft.core.types import CageMethodName
from taichi_soft.meshing import TetMesh
from taichi_soft.meshing.surfaces import Surface, joined

METHODS = get_args(CageMethodName)


def tetrahedra_of(
    surfaces: tuple[Surface, ...],
    *,
    cells: int | None = None,
    cell_size: float | None = None,
    method: CageMethodName = "lattice",
    time_limit: float | None = None,
) -> tuple[TetMesh, float]:
    """Tetrahedra for the solid that surfaces enclose, and the edge of a cell [m].

    Arguments and errors: `SoftBodyAsset.from_surface`.
    """
    if method not in METHODS:
        raise OptionError(f"unknown method {method!r}: choose one of {', '.join(map(repr, METHODS))}")
    if method == "lattice" and time_limit is not None:
        raise OptionError(f"time_limit={time_limit!r}: method 'lattice' takes none, it ends by itself")
    limit = TIME_LIMIT if time_limit is None else as_positive(time_limit, "time_limit", "s")
    vertices, triangles = joined(surfaces)
    edge = cell_size_of(np.ptp(vertices[np.unique(triangles)], axis=0), cells, cell_size)
    if method == "lattice":
        return lattice_cage(vertices, triangles, edge).mesh, edge
    return mesher_mesh(method, vertices, triangles, edge, limit), edge
