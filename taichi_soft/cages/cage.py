"""Build the cage of a solid. A cage is a set of tetrahedra that carry the solid's volume and mass."""

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
"""A component is discarded if its volume is below this fraction of the solid's volume."""

MIN_FILL = 0.05
"""Smallest fill of a tetrahedron. Lower fills are raised to this value, because the neighbours of a very
light tetrahedron would accelerate it too strongly."""

MAX_FILL = 1.5
"""Largest fill of a tetrahedron. It can exceed 1, because tetrahedra also carry the parts of the solid
outside the cage. The limit bounds the stiffness that these parts add."""

MIN_LUMPED_FRACTION = 0.9
"""Smallest volume of a vertex, as a fraction of its lumped volume. The lumped volume is a quarter of the
solid in the tetrahedra around the vertex. Stiffness grows with the fill, so a lighter vertex would vibrate
fast and shorten the stable step."""

MAX_PEELS = 4
"""Largest number of layers of flat tetrahedra that are removed."""


@dataclass(frozen=True, eq=False)
class Cage:
    """Tetrahedra around a solid. Each tetrahedron and each vertex carries a part of the solid."""

    mesh: CageMesh
    solid: Solid
    part: Ints  # (m,), component of the solid that each tetrahedron belongs to
    octave: Ints  # (m,), number of halvings of the cells at each tetrahedron
    thin: Thin | None = None  # parts that are too thin for the requested cells; None if there are none


def cage_in(
    lattice: Lattice | GradedLattice,
    solid: Solid,
    enclosed_volume: float,
    kept: NDArray[np.bool_] | None = None,
) -> Cage:
    """Build the cage of a solid from tetrahedra of a lattice.

    Args:
        enclosed_volume: volume of the solid by the divergence theorem [m^3].
        kept: True for voxels that the cage must cover, with the shape of `solid.fill`.
    Raises: OptionError if the cage would fall into pieces.
    """
    points, volumes = solid.quadrature()
    if solid.is_simple:
        volumes *= enclosed_volume / volumes.sum()
    is_full = solid.fill > 0.0
    part_of_point = parts_of(solid.fill)[is_full]
    is_kept = None if kept is None else kept[is_full]
    positions, corners, parts, octaves, offset = [], [], [], [], 0
    tet_count = 0
    start = np.full(len(points), -1)
    large = np.flatnonzero(np.bincount(part_of_point, volumes) >= SMALLEST_PART * volumes.sum())
    for number, part in enumerate(large):
        in_part = part_of_point == part
        numbers = mark(
            lattice, points[in_part], volumes[in_part], None if is_kept is None else is_kept[in_part]
        )
        numbers = _peeled(lattice, numbers, solid)
        tets, lattice_vertices = split_hinges(lattice.corners_of(numbers))
        if part_count(tets) > 1:
            raise OptionError(
                f"cells of {lattice.edge:.4g} m are too large: parts of the surface are so thin that the "
                f"cage falls into {part_count(tets)} pieces. Take cell_size={0.5 * lattice.edge:.3g} or less"
            )
        at = lattice.points_of(lattice_vertices)
        octave = lattice.octaves_of(numbers)
        positions.append(fit(at, tets, octave, solid, lattice.edge))
        corners.append(tets + offset)
        parts.append(np.full(len(tets), number))
        octaves.append(octave)
        at_points = lattice.tet_at(points[in_part])
        row = np.minimum(np.searchsorted(numbers, at_points), len(numbers) - 1)
        start[in_part] = np.where(numbers[row] == at_points, row + tet_count, -1)
        offset, tet_count = offset + len(at), tet_count + len(tets)
    in_large = np.isin(part_of_point, large)
    mesh = TetMesh(np.concatenate(positions), np.concatenate(corners))
    cage_mesh = _with_volumes(mesh, solid, points[in_large], volumes[in_large], start[in_large])
    return Cage(cage_mesh, solid, np.concatenate(parts), np.concatenate(octaves))


def _peeled(lattice: Lattice | GradedLattice, numbers: Ints, solid: Solid) -> Ints:
    """Remove tetrahedra that the surface would flatten, but keep the rest connected.

    Returns: numbers of the remaining tetrahedra, ascending.
    """
    for _ in range(MAX_PEELS):
        corners = lattice.corners_of(numbers)
        used, tets = np.unique(corners, return_inverse=True)
        tets = tets.reshape(-1, 4)
        kept = without_flat(corners, caps(lattice.points_of(used), tets, solid, lattice.edge))
        if kept.all():
            break
        numbers = numbers[kept]
    return numbers


def _with_volumes(
    mesh: TetMesh, solid: Solid, points: FloatArray, volumes: FloatArray, start: Ints
) -> CageMesh:
    """Return the mesh with the fill of each tetrahedron and the volume of each vertex."""
    tet, weights = Locator(mesh)(points, start)
    carried = np.bincount(tet, volumes, len(mesh.tets))
    fill = np.clip(carried / mesh.volumes, MIN_FILL, MAX_FILL)
    lumped_volumes = np.bincount(
        mesh.tets[tet].ravel(), (volumes[:, None] * weights).ravel(), len(mesh.vertices)
    )
    quarters = lumped(mesh.tets, fill * mesh.volumes, len(mesh.vertices))
    lumped_volumes = np.maximum(lumped_volumes, MIN_LUMPED_FRACTION * quarters)
    cell = solid.spacing**2 / 12.0  # second moment of a full voxel, divided by the voxel's volume
    second_moment = np.einsum("k,ki,kj->ij", volumes, points, points) + volumes.sum() * cell * np.eye(3)
    vertex_volumes = fitted(
        mesh.vertices,
        np.asarray(lumped_volumes, dtype=np.float64),
        float(volumes.sum()),
        volumes @ points,
        second_moment,
    )
    return CageMesh(mesh.vertices, mesh.tets, fill, vertex_volumes)
