"""The ways from a surface to tetrahedra."""

from __future__ import annotations

from typing import NamedTuple, get_args

import numpy as np

from taichi_soft.cages.cell_size import cell_size_of
from taichi_soft.cages.lattice_cage import lattice_cage
from taichi_soft.cages.mesher import TIME_LIMIT, mesher_mesh
from taichi_soft.cages.refinement import REFINE
from taichi_soft.cages.thin import MOST_REFINE
from taichi_soft.core.checks import as_count, as_positive, choose_one_of
from taichi_soft.core.errors import OptionError
from taichi_soft.core.types import CageMethodName
from taichi_soft.meshing import TetMesh
from taichi_soft.meshing.surface import Surface, joined

METHODS = get_args(CageMethodName)


class Tetrahedra(NamedTuple):
    """What a method makes of surfaces."""

    mesh: TetMesh
    cell_size: float  # edge of a cell, as asked for [m]
    told: tuple[str, ...] = ()  # what is to be said of limbs and sheets that are too thin for these
    is_refined: bool = False  # some got smaller cells


def tetrahedra_of(
    surfaces: tuple[Surface, ...],
    *,
    cells: int | None = None,
    cell_size: float | None = None,
    method: CageMethodName = "lattice",
    time_limit: float | None = None,
    refine: int | None = None,
) -> Tetrahedra:
    """Tetrahedra for the solid that surfaces enclose.

    Arguments and errors: `SoftBodyAsset.from_surface`.
    """
    if method not in METHODS:
        raise OptionError(f"unknown method {method!r}: {choose_one_of(METHODS, method)}")
    if method == "lattice" and time_limit is not None:
        raise OptionError(f"time_limit={time_limit!r}: method 'lattice' takes none, it ends by itself")
    if method != "lattice" and refine is not None:
        raise OptionError(f"refine={refine!r}: method {method!r} takes none, it keeps what is thin by itself")
    octaves = REFINE if refine is None else as_count(refine, "refine", 0, MOST_REFINE)
    limit = TIME_LIMIT if time_limit is None else as_positive(time_limit, "time_limit", "s")
    vertices, triangles = joined(surfaces)
    edge = cell_size_of(np.ptp(vertices[np.unique(triangles)], axis=0), cells, cell_size)
    if method == "lattice":
        cage = lattice_cage(vertices, triangles, edge, octaves)
        told = () if cage.thin is None else cage.thin.words(edge)
        return Tetrahedra(cage.mesh, edge, told, bool(cage.octave.any()))
    return Tetrahedra(mesher_mesh(method, vertices, triangles, edge, limit), edge)
