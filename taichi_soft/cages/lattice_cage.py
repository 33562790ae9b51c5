"""From a surface to its cage in a lattice, with smaller cells where limbs and sheets would be left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taichi_soft.cages.cage import Cage, cage_in
from taichi_soft.cages.cell_size import cell_size_of
from taichi_soft.cages.lattice import Lattice
from taichi_soft.cages.refinement import REFINE, octaves_for, refined, traced
from taichi_soft.cages.solid import Solid, solid_of
from taichi_soft.cages.thin import LeftOut, Thin, far_points, left_out, solid_points, torn_points
from taichi_soft.cages.voxels import fine_voxel_edge, require_solid, volume_within, voxel_edge
from taichi_soft.core.errors import OptionError
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.surface import Surface, joined

Ints = NDArray[np.int64]

ROUNDS = 3
"""In which limbs are looked for that a cage leaves out."""


def build_cage(
    surfaces: tuple[Surface, ...],
    *,
    cells: int | None = None,
    cell_size: float | None = None,
    refine: int = REFINE,
) -> Cage:
    """The cage of a solid that surfaces enclose together. Arguments as of `SoftBodyAsset.from_surface`."""
    vertices, triangles = joined(surfaces)
    size = np.ptp(vertices[np.unique(triangles)], axis=0)
    return lattice_cage(vertices, triangles, cell_size_of(size, cells, cell_size), refine)


def lattice_cage(vertices: FloatArray, triangles: Ints, cell_size: float, refine: int = REFINE) -> Cage:
    """A cage of a lattice's tetrahedra.

    Args:
        vertices: of the surface, (n, 3) [m].
        triangles: (m, 3).
        cell_size: edge of the lattice's cubes [m].
        refine: how often these may be halved where limbs and sheets would be left out.
    Raises: MeshError for a surface that encloses nothing, or is open for the most part.
    """
    corners = vertices[triangles]
    used = vertices[np.unique(triangles)]
    low, high = used.min(axis=0), used.max(axis=0)
    solid = solid_of(vertices, triangles, voxel_edge(corners, cell_size))
    within = abs(volume_within(corners))
    require_solid(solid, high - low, within, cell_size)
    lattice = Lattice.round(low, high, cell_size)
    cage = cage_in(lattice, solid, within)
    if cage.part[-1] > 0:
        torn = torn_points(solid, vertices, triangles)
        if len(torn):
            solid, kept = traced(solid, torn)
            cage = cage_in(lattice, solid, within, kept)
    return Search(lattice, vertices, triangles, within).kept(cage, refine)


class Search:
    """What a first cage leaves out, looked for and kept."""

    def __init__(self, lattice: Lattice, vertices: FloatArray, triangles: Ints, within: float) -> None:
        self._lattice, self._vertices, self._triangles = lattice, vertices, triangles
        self._corners, self._within = vertices[triangles], within

    def kept(self, cage: Cage, refine: int) -> Cage:
        """A cage of smaller cells, where limbs are left out that are not too thin for these."""
        far, triangle = far_points(self._lattice, self._corners, cage.mesh)
        if len(far) == 0:
            return cage
        edge = fine_voxel_edge(self._corners, self._lattice.edge)
        fine = solid_of(self._vertices, self._triangles, edge)
        lost = self._left_out(cage, fine, far, triangle)
        if lost is None:
            return cage
        chosen = lost.among(self._lattice, np.zeros_like(lost.cubes))
        torn = torn_points(fine, self._vertices, self._triangles)
        for _ in range(ROUNDS if refine else 0):  # finer voxels lose other limbs that are as thin
            worth = lost.among(self._lattice, octaves_for(self._lattice, fine, lost, refine) > 0)
            if not (worth.cubes & ~chosen.cubes).any():
                break
            wanted = chosen.joined(worth)
            solid, voxels = traced(fine, np.concatenate([wanted.points, torn]))
            octaves = octaves_for(self._lattice, fine, wanted, refine)
            graded = refined(self._lattice, octaves, wanted.points)
            try:
                cage = cage_in(graded, solid, self._within, voxels)
            except OptionError:  # in pieces: better without these limbs, and said so
                break
            chosen = wanted
            lost = self._left_out(cage, fine, *far_points(self._lattice, self._corners, cage.mesh))
            if lost is None:
                break
        kept, left = chosen.thinnest, np.inf if lost is None else lost.thinnest
        return replace(cage, thin=Thin(kept, left, int(cage.octave.max())))

    def _left_out(self, cage: Cage, fine: Solid, far: FloatArray, triangle: Ints) -> LeftOut | None:
        far = solid_points(self._lattice, far, triangle, self._corners, fine)
        return left_out(self._lattice, self._corners, cage.mesh, far) if len(far) else None
