"""Build the cage of a surface from a lattice. Limbs and sheets that the cage would miss get smaller cells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taichi_soft.cages.cage import Cage, cage_in
from taichi_soft.cages.cell_size import cell_size_of
from taichi_soft.cages.lattice import Lattice
from taichi_soft.cages.refinement import REFINE, octaves_for, refined, traced
from taichi_soft.cages.solid import Solid, solid_of
from taichi_soft.cages.thin import MissedParts, Thin, far_points, find_missed, solid_points, torn_points
from taichi_soft.cages.voxels import fine_voxel_edge, require_solid, volume_within, voxel_edge
from taichi_soft.core.errors import OptionError
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.surface import Surface, joined

Ints = NDArray[np.int64]

ROUNDS = 3
"""Largest number of refinements. Each refinement is followed by a search for limbs that are still missed."""


def build_cage(
    surfaces: tuple[Surface, ...],
    *,
    cells: int | None = None,
    cell_size: float | None = None,
    refine: int = REFINE,
) -> Cage:
    """Build the cage of the solid that surfaces enclose.

    The arguments are those of `SoftBodyAsset.from_surface`.
    """
    vertices, triangles = joined(surfaces)
    size = np.ptp(vertices[np.unique(triangles)], axis=0)
    return lattice_cage(vertices, triangles, cell_size_of(size, cells, cell_size), refine)


def lattice_cage(vertices: FloatArray, triangles: Ints, cell_size: float, refine: int = REFINE) -> Cage:
    """Build the cage of the solid inside a surface from a lattice's tetrahedra.

    Args:
        vertices: vertices of the surface, (n, 3) [m].
        triangles: (m, 3).
        cell_size: edge of the lattice's cubes [m].
        refine: largest number of halvings of the cubes at limbs and sheets that would otherwise be missed.
    Raises: MeshError for a surface that encloses nothing or is mostly open.
    """
    corners = vertices[triangles]
    used = vertices[np.unique(triangles)]
    low, high = used.min(axis=0), used.max(axis=0)
    solid = solid_of(vertices, triangles, voxel_edge(corners, cell_size))
    enclosed_volume = abs(volume_within(corners))
    require_solid(solid, high - low, enclosed_volume, cell_size)
    lattice = Lattice.around_box(low, high, cell_size)
    cage = cage_in(lattice, solid, enclosed_volume)
    if cage.part[-1] > 0:
        torn = torn_points(solid, vertices, triangles)
        if len(torn):
            solid, covered = traced(solid, torn)
            cage = cage_in(lattice, solid, enclosed_volume, covered)
    return Refinement(lattice, vertices, triangles, enclosed_volume).refined(cage, refine)


class Refinement:
    """Refinement of a lattice at the parts of a surface that the first cage misses."""

    def __init__(
        self, lattice: Lattice, vertices: FloatArray, triangles: Ints, enclosed_volume: float
    ) -> None:
        self._lattice, self._vertices, self._triangles = lattice, vertices, triangles
        self._corners, self._enclosed_volume = vertices[triangles], enclosed_volume

    def refined(self, cage: Cage, refine: int) -> Cage:
        """Return a cage with smaller cells at the limbs that `cage` misses.

        Limbs that are still too thin after `refine` halvings of the cells stay missed.
        """
        far, triangle = far_points(self._lattice, self._corners, cage.mesh)
        if len(far) == 0:
            return cage
        edge = fine_voxel_edge(self._corners, self._lattice.edge)
        fine = solid_of(self._vertices, self._triangles, edge)
        missed = self._missed_parts(cage, fine, far, triangle)
        if missed is None:
            return cage
        chosen = missed.among(self._lattice, np.zeros_like(missed.cubes))
        torn = torn_points(fine, self._vertices, self._triangles)
        for _ in range(ROUNDS if refine else 0):  # a cage from finer voxels can miss other thin limbs
            worth = missed.among(self._lattice, octaves_for(self._lattice, fine, missed, refine) > 0)
            if not (worth.cubes & ~chosen.cubes).any():
                break
            candidate = chosen.joined(worth)
            solid, voxels = traced(fine, np.concatenate([candidate.points, torn]))
            octaves = octaves_for(self._lattice, fine, candidate, refine)
            graded = refined(self._lattice, octaves, candidate.points)
            try:
                cage = cage_in(graded, solid, self._enclosed_volume, voxels)
            except OptionError:  # the cage would fall into pieces: leave out these limbs and report them
                break
            chosen = candidate
            missed = self._missed_parts(cage, fine, *far_points(self._lattice, self._corners, cage.mesh))
            if missed is None:
                break
        covered, left = chosen.thinnest, np.inf if missed is None else missed.thinnest
        return replace(cage, thin=Thin(covered, left, int(cage.octave.max())))

    def _missed_parts(self, cage: Cage, fine: Solid, far: FloatArray, triangle: Ints) -> MissedParts | None:
        far = solid_points(self._lattice, far, triangle, self._corners, fine)
        return find_missed(self._lattice, self._corners, cage.mesh, far) if len(far) else None
