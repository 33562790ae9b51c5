"""A cage: tetrahedra that carry a solid which only its surface is known of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.cages.connected import parts_of
from taichi_soft.cages.fitting import caps, fit
from taichi_soft.cages.graded import GradedLattice
from taichi_soft.cages.lattice import Lattice
from taichi_soft.cages.marking import mark, part_count, split_hinges, without_flat
from taichi_soft.cages.masses import fitted
from taichi_soft.cages.solid import Solid
from taichi_soft.cages.thin import Thin
from taichi_soft.core.errors import OptionError
from taichi_soft.meshing import TetMesh
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.cage_mesh import CageMesh, lumped
from taichi_soft.meshing.locating import Locator

Ints = NDArray[np.int64]

SMALLEST_PART = 1e-3
"""Of the volume: smaller parts are dust."""

LEAST_SHARE = 0.05
"""Of a tetrahedron that is solid, below which it is taken as this much: what is lighter than all round it
would be thrown about."""

MOST_SHARE = 1.5
"""Above it what sticks out of the cage stiffens nothing more."""

LEAST_QUARTER = 0.9
"""Of a quarter of what is solid of the tetrahedra round a vertex, that it is to carry at least: they pull at
it as hard as they are full, and a light vertex vibrates fast. Stable steps gain up to a half by it."""

PEELS = 4
"""Layers of flat tetrahedra that are taken off at most."""


@dataclass(frozen=True, eq=False)
class Cage:
    """Tetrahedra, and what of the solid each of them and each vertex carries."""

    mesh: CageMesh
    solid: Solid
    part: Ints  # (m,), of the solid that each tetrahedron belongs to
    octave: Ints  # (m,), how often the cells were halved there
    thin: Thin | None = None  # limbs and sheets that cells as large as asked for leave out


def cage_in(
    lattice: Lattice | GradedLattice, solid: Solid, within: float, kept: NDArray[np.bool_] | None = None
) -> Cage:
    """The cage of a solid in a lattice.

    Args:
        within: volume by the divergence theorem [m^3].
        kept: voxels that are not to be lost, of the shape of the solid's.
    Raises: OptionError where it falls into pieces.
    """
    points, volumes = solid.quadrature()
    if solid.is_simple:
        volumes *= within / volumes.sum()
    is_full = solid.fill > 0.0
    part_of_point = parts_of(solid.fill)[is_full]
    is_kept = None if kept is None else kept[is_full]
    places, corners, parts, octaves, offset = [], [], [], [], 0
    tet_count = 0
    start = np.full(len(points), -1)
    large = np.flatnonzero(np.bincount(part_of_point, volumes) >= SMALLEST_PART * volumes.sum())
    for number, part in enumerate(large):
        mine = part_of_point == part
        numbers = mark(lattice, points[mine], volumes[mine], None if is_kept is None else is_kept[mine])
        numbers = _peeled(lattice, numbers, solid)
        tets, lattice_vertices = split_hinges(lattice.corners_of(numbers))
        if part_count(tets) > 1:
            raise OptionError(
                f"cells of {lattice.edge:.4g} m are too large: parts of the surface are so thin that the "
                f"cage falls into {part_count(tets)} pieces. Take cell_size={0.5 * lattice.edge:.3g} or less"
            )
        at = lattice.points_of(lattice_vertices)
        octave = lattice.octaves_of(numbers)
        places.append(fit(at, tets, octave, solid, lattice.edge))
        corners.append(tets + offset)
        parts.append(np.full(len(tets), number))
        octaves.append(octave)
        at_points = lattice.tet_at(points[mine])
        found = np.minimum(np.searchsorted(numbers, at_points), len(numbers) - 1)
        start[mine] = np.where(numbers[found] == at_points, found + tet_count, -1)
        offset, tet_count = offset + len(at), tet_count + len(tets)
    in_large = np.isin(part_of_point, large)
    mesh = TetMesh(np.concatenate(places), np.concatenate(corners))
    filled = _filled(mesh, solid, points[in_large], volumes[in_large], start[in_large])
    return Cage(filled, solid, np.concatenate(parts), np.concatenate(octaves))


def _peeled(lattice: Lattice | GradedLattice, numbers: Ints, solid: Solid) -> Ints:
    """Without tetrahedra that would lie flat in the surface, as long as what is left hangs together."""
    for _ in range(PEELS):
        corners = lattice.corners_of(numbers)
        used, tets = np.unique(corners, return_inverse=True)
        tets = tets.reshape(-1, 4)
        kept = without_flat(corners, caps(lattice.points_of(used), tets, solid, lattice.edge))
        if kept.all():
            break
        numbers = numbers[kept]
    return numbers


def _filled(mesh: TetMesh, solid: Solid, points: FloatArray, volumes: FloatArray, start: Ints) -> CageMesh:
    tet, shares = Locator(mesh)(points, start)
    carried = np.bincount(tet, volumes, len(mesh.tets))
    fill = np.clip(carried / mesh.volumes, LEAST_SHARE, MOST_SHARE)
    held = np.bincount(mesh.tets[tet].ravel(), (volumes[:, None] * shares).ravel(), len(mesh.vertices))
    quarters = lumped(mesh.tets, fill * mesh.volumes, len(mesh.vertices))
    held = np.maximum(held, LEAST_QUARTER * quarters)
    cell = solid.spacing**2 / 12.0  # a full voxel's own second moment over its volume
    second = np.einsum("k,ki,kj->ij", volumes, points, points) + volumes.sum() * cell * np.eye(3)
    vertex_volumes = fitted(
        mesh.vertices, np.asarray(held, dtype=np.float64), float(volumes.sum()), volumes @ points, second
    )
    return CageMesh(mesh.vertices, mesh.tets, fill, vertex_volumes)
