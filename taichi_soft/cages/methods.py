"""Methods that make tetrahedra from a surface."""

from __future__ import annotations

from typing import NamedTuple, get_args

import numpy as np

from taichi_soft.cages.cell_size import cell_size_of
from taichi_soft.cages.lattice_cage import lattice_cage
from taichi_soft.cages.mesher import TIME_LIMIT, mesher_mesh
from taichi_soft.cages.refinement import REFINE
from taichi_soft.cages.thin import MAX_REFINE
from taichi_soft.core.checks import as_count, as_positive, choose_one_of
from taichi_soft.core.errors import OptionError
from taichi_soft.core.types import CageMethodName
from taichi_soft.meshing import TetMesh
from taichi_soft.meshing.surface import Surface, joined

METHODS = get_args(CageMethodName)


class Tetrahedra(NamedTuple):
    """Tetrahedra that a method makes from surfaces."""

    mesh: TetMesh
    cell_size: float  # requested edge of a cell [m]
    notes: tuple[str, ...] = ()  # messages about limbs and sheets that are too thin for cells of this size
    is_refined: bool = False  # True if some limbs or sheets have smaller cells


def tetrahedra_of(
    surfaces: tuple[Surface, ...],
    *,
    cells: int | None = None,
    cell_size: float | None = None,
    method: CageMethodName = "lattice",
    time_limit: float | None = None,
    refine: int | None = None,
) -> Tetrahedra:
    """Make tetrahedra for the solid that surfaces enclose.

    The arguments and errors are those of `SoftBodyAsset.from_surface`.
    """
    if method not in METHODS:
        raise OptionError(f"unknown method {method!r}: {choose_one_of(METHODS, method)}")
    if method == "lattice" and time_limit is not None:
        raise OptionError(f"time_limit={time_limit!r}: method 'lattice' always ends, so leave it out")
    if method != "lattice" and refine is not None:
        raise OptionError(f"refine={refine!r}: method {method!r} always keeps thin parts, so leave it out")
    octaves = REFINE if refine is None else as_count(refine, "refine", 0, MAX_REFINE)
    limit = TIME_LIMIT if time_limit is None else as_positive(time_limit, "time_limit", "s")
    vertices, triangles = joined(surfaces)
    edge = cell_size_of(np.ptp(vertices[np.unique(triangles)], axis=0), cells, cell_size)
    if method == "lattice":
        cage = lattice_cage(vertices, triangles, edge, octaves)
        notes = () if cage.thin is None else cage.thin.notes(edge)
        return Tetrahedra(cage.mesh, edge, notes, bool(cage.octave.any()))
    return Tetrahedra(mesher_mesh(method, vertices, triangles, edge, limit), edge)
