"""Choose the voxel size of a solid, and check the solid."""

from __future__ import annotations

import numpy as np

from taichi_soft.cages.solid import Solid
from taichi_soft.core.errors import MeshError, OptionError
from taichi_soft.meshing.arrays import FloatArray

VOXELS_PER_CUBE = 8
"""Default number of voxels along the edge of a cube."""

MIN_VOXELS_PER_CUBE, MAX_VOXELS_PER_CUBE = 3, 16

MAX_VOXELS = 1 << 22
"""Largest number of voxels of a solid. If it is exceeded, voxels are made coarser, down to
`MIN_VOXELS_PER_CUBE` along the edge of a cube."""

MAX_FINE_VOXELS = 1 << 21
"""Largest number of voxels in the search for missed limbs. If it is exceeded, voxels are made coarser."""

MAX_OPEN_FRACTION = 0.5
"""A surface counts as an open sheet if more than this fraction of the rays that enter it do not leave it
again."""

FLATTEST = 1e-6
"""Enclosed volumes below this fraction of the volume of the bounding box count as rounding errors."""


def volume_within(corners: FloatArray) -> float:
    """Return the volume inside a closed surface of triangles (m, 3, 3), by the divergence theorem [m^3]."""
    a, b, c = np.moveaxis(corners - corners[0, 0], 1, 0)  # far from the origin, only differences are precise
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0


def voxel_edge(corners: FloatArray, cell_size: float) -> float:
    """Return the edge of voxels that resolve the solid [m].

    The thickness of a sheet is twice its volume divided by its surface area. Two voxels should fit into this
    thickness.
    """
    area_vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * float(np.linalg.norm(area_vectors, axis=1).sum())
    if area == 0.0:
        raise MeshError("the surface has no area: it encloses nothing")
    edge = min(
        cell_size / VOXELS_PER_CUBE, max(abs(volume_within(corners)) / area, cell_size / MAX_VOXELS_PER_CUBE)
    )
    return _affordable(edge, corners, cell_size, MAX_VOXELS)


def fine_voxel_edge(corners: FloatArray, cell_size: float) -> float:
    """Return the edge of the finer voxels that are used in the search for missed limbs [m]."""
    edge = _affordable(cell_size / MAX_VOXELS_PER_CUBE, corners, cell_size, MAX_FINE_VOXELS)
    return min(edge, voxel_edge(corners, cell_size))


def _affordable(edge: float, corners: FloatArray, cell_size: float, max_voxels: int) -> float:
    """Return `edge` [m], enlarged until there are at most `max_voxels` voxels.

    The result is never larger than `cell_size / MIN_VOXELS_PER_CUBE`.
    """
    size = np.ptp(corners.reshape(-1, 3), axis=0)
    while edge < cell_size / MIN_VOXELS_PER_CUBE and np.prod(size / edge + 3.0) > max_voxels:
        edge *= 1.1
    return min(edge, cell_size / MIN_VOXELS_PER_CUBE)


def require_solid(solid: Solid, size: FloatArray, enclosed_volume: float, cell_size: float) -> None:
    """Check that voxels contain a solid.

    Args:
        size: sides of the bounding box of the surface, (3,) [m].
        enclosed_volume: volume by the divergence theorem [m^3].
        cell_size: edge of a cell [m].
    Raises: MeshError if there is no solid; OptionError if the solid is lost between the voxels.
    """
    if solid.open_fraction > MAX_OPEN_FRACTION:
        raise MeshError(
            f"the surface is open: {100 * solid.open_fraction:.3g} % of the rays into it do not come out "
            "again. Give a sheet a thickness (Blender: Solidify), or make a cloth of it by ParticleMesh"
        )
    least = FLATTEST * float(np.prod(size))
    if solid.is_simple and enclosed_volume > least and solid.volume < 0.5 * enclosed_volume:
        raise OptionError(
            f"cells of {cell_size:.4g} m are too large: the solid of {enclosed_volume:.3g} m^3 is too thin "
            f"for them. Take cell_size={0.5 * cell_size:.3g} or less"
        )
    if solid.volume <= FLATTEST * float(np.prod(np.maximum(size, solid.spacing))):
        raise MeshError(f"the surface encloses no volume ({solid.volume:.2g} m^3): give it a thickness")
