"""A cage: tetrahedra that carry a solid which only its surface is known of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.cages.cell_size import cell_size_of
from taichi_soft.cages.connected import parts_of
from taichi_soft.cages.fitting import caps, fit
from taichi_soft.cages.lattice import Lattice
from taichi_soft.cages.marking import mark, part_count, split_hinges, without_flat
from taichi_soft.cages.masses import fitted
from taichi_soft.cages.solid import Solid, solid_of
from taichi_soft.core.errors import MeshError, OptionError
from taichi_soft.meshing import TetMesh
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.cage_mesh import CageMesh, lumped
from taichi_soft.meshing.locating import Locator
from taichi_soft.meshing.surfaces import Surface, joined

Ints = NDArray[np.int64]

FINENESS = 8
"""Voxels along a cube."""

LEAST_FINENESS, MOST_FINENESS = 3, 16

MOST_VOXELS = 1 << 22
"""Above, voxels are coarser, but for `LEAST_FINENESS`."""

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

OPEN = 0.5
"""Of all lines that meet a surface: more that do not leave it again, and it is a sheet."""

FLATTEST = 1e-6
"""Volume over that of the box round it, below which nothing is enclosed but rounding."""


@dataclass(frozen=True, eq=False)
class Cage:
    """Tetrahedra, and what of the solid each of them and each vertex carries."""

    mesh: CageMesh
    solid: Solid
    part: Ints  # (m,), of the solid that each tetrahedron belongs to


def build_cage(
    surfaces: tuple[Surface, ...], *, cells: int | None = None, cell_size: float | None = None
) -> Cage:
    """The cage of a solid that surfaces enclose together. Arguments as of `SoftBodyAsset.from_surface`."""
    vertices, triangles = joined(surfaces)
    size = np.ptp(vertices[np.unique(triangles)], axis=0)
    return lattice_cage(vertices, triangles, cell_size_of(size, cells, cell_size))


def lattice_cage(vertices: FloatArray, triangles: Ints, cell_size: float) -> Cage:
    """A cage of a lattice's tetrahedra.

    Args:
        vertices: of the surface, (n, 3) [m].
        triangles: (m, 3).
        cell_size: edge of the lattice's cubes [m].
    Raises: MeshError for a surface that encloses nothing, or is open for the most part.
    """
    used = vertices[np.unique(triangles)]
    low, high = used.min(axis=0), used.max(axis=0)
    solid = solid_of(vertices, triangles, _voxel_edge(vertices[triangles], cell_size))
    within = abs(volume_within(vertices[triangles]))
    _require_solid(solid, high - low, within, cell_size)
    points, volumes = solid.quadrature()
    if solid.is_simple:
        volumes *= within / volumes.sum()
    part_of_point = parts_of(solid.fill)[solid.fill > 0.0]
    lattice = Lattice.round(low, high, cell_size)
    places, corners, parts, offset = [], [], [], 0
    tet_count = 0
    start = np.full(len(points), -1)
    large = np.flatnonzero(np.bincount(part_of_point, volumes) >= SMALLEST_PART * volumes.sum())
    for number, part in enumerate(large):
        mine = part_of_point == part
        numbers = mark(lattice, points[mine], volumes[mine])
        numbers = _peeled(lattice, numbers, solid)
        tets, lattice_vertices = split_hinges(lattice.corners_of(numbers))
        if part_count(tets) > 1:
            raise OptionError(
                f"cells of {cell_size:.4g} m are too large: parts of the surface are so thin that the cage "
                f"falls into {part_count(tets)} pieces. Take cell_size={0.5 * cell_size:.3g} or less"
            )
        at = lattice.points_of(lattice_vertices)
        places.append(fit(at, tets, solid, cell_size))
        corners.append(tets + offset)
        parts.append(np.full(len(tets), number))
        at_points = lattice.tet_at(points[mine])
        found = np.minimum(np.searchsorted(numbers, at_points), len(numbers) - 1)
        start[mine] = np.where(numbers[found] == at_points, found + tet_count, -1)
        offset, tet_count = offset + len(at), tet_count + len(tets)
    kept = np.isin(part_of_point, large)
    mesh = TetMesh(np.concatenate(places), np.concatenate(corners))
    return _filled(mesh, np.concatenate(parts), solid, points[kept], volumes[kept], start[kept])


def volume_within(corners: FloatArray) -> float:
    """Of a closed surface of triangles (m, 3, 3), by the divergence theorem [m^3]."""
    return float(np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))) / 6.0


def _voxel_edge(corners: FloatArray, cell_size: float) -> float:
    """Of voxels in which the solid can be told [m].

    A sheet is as thick as twice its volume over its surface: it is to have two voxels across.
    """
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * float(np.linalg.norm(doubled, axis=1).sum())
    if area == 0.0:
        raise MeshError("the surface has no area: it encloses nothing")
    edge = min(cell_size / FINENESS, max(abs(volume_within(corners)) / area, cell_size / MOST_FINENESS))
    size = np.ptp(corners.reshape(-1, 3), axis=0)
    while edge < cell_size / LEAST_FINENESS and np.prod(size / edge + 3.0) > MOST_VOXELS:
        edge *= 1.1
    return min(edge, cell_size / LEAST_FINENESS)


def _require_solid(solid: Solid, size: FloatArray, within: float, cell_size: float) -> None:
    """Raises: MeshError where there is nothing to carry, OptionError where it is lost between the voxels.

    Args: within: volume by the divergence theorem [m^3].
    """
    if solid.open_share > OPEN:
        raise MeshError(
            f"the surface is open: {100 * solid.open_share:.3g} % of the lines through it do not come out "
            "again. Give a sheet a thickness (Blender: Solidify), or make a cloth of it by ParticleMesh"
        )
    least = FLATTEST * float(np.prod(size))
    if solid.is_simple and within > least and solid.volume < 0.5 * within:
        raise OptionError(
            f"cells of {cell_size:.4g} m are too large: the solid of {within:.3g} m^3 is too thin for them. "
            f"Take cell_size={0.5 * cell_size:.3g} or less"
        )
    if solid.volume <= FLATTEST * float(np.prod(np.maximum(size, solid.spacing))):
        raise MeshError(f"the surface encloses no volume ({solid.volume:.2g} m^3): give it a thickness")


def _peeled(lattice: Lattice, numbers: Ints, solid: Solid) -> Ints:
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


def _filled(
    mesh: TetMesh, parts: Ints, solid: Solid, points: FloatArray, volumes: FloatArray, start: Ints
) -> Cage:
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
    return Cage(CageMesh(mesh.vertices, mesh.tets, fill, vertex_volumes), solid, parts)
