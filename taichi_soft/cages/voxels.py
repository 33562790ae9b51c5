"""How large the voxels are in which a solid is told, and whether it is one."""

from __future__ import annotations

import numpy as np

from taichi_soft.cages.solid import Solid
from taichi_soft.core.errors import MeshError, OptionError
from taichi_soft.meshing.arrays import FloatArray

FINENESS = 8
"""Voxels along a cube."""

LEAST_FINENESS, MOST_FINENESS = 3, 16

MOST_VOXELS = 1 << 22
"""Above, voxels are coarser, but for `LEAST_FINENESS`."""

MOST_FINE_VOXELS = 1 << 21
"""The same, where limbs were lost."""

OPEN = 0.5
"""Of all lines that meet a surface: more that do not leave it again, and it is a sheet."""

FLATTEST = 1e-6
"""Volume over that of the box round it, below which nothing is enclosed but rounding."""


def volume_within(corners: FloatArray) -> float:
    """Of a closed surface of triangles (m, 3, 3), by the divergence theorem [m^3]."""
    a, b, c = np.moveaxis(corners - corners[0, 0], 1, 0)  # far from the origin, only differences have digits
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0


def voxel_edge(corners: FloatArray, cell_size: float) -> float:
    """Of voxels in which the solid can be told [m].

    A sheet is as thick as twice its volume over its surface: it is to have two voxels across.
    """
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * float(np.linalg.norm(doubled, axis=1).sum())
    if area == 0.0:
        raise MeshError("the surface has no area: it encloses nothing")
    edge = min(cell_size / FINENESS, max(abs(volume_within(corners)) / area, cell_size / MOST_FINENESS))
    return _affordable(edge, corners, cell_size, MOST_VOXELS)


def fine_voxel_edge(corners: FloatArray, cell_size: float) -> float:
    """Of voxels for limbs that were lost between coarser ones [m]."""
    edge = _affordable(cell_size / MOST_FINENESS, corners, cell_size, MOST_FINE_VOXELS)
    return min(edge, voxel_edge(corners, cell_size))


def _affordable(edge: float, corners: FloatArray, cell_size: float, most: int) -> float:
    """An edge that is longer where there would be too many voxels [m]."""
    size = np.ptp(corners.reshape(-1, 3), axis=0)
    while edge < cell_size / LEAST_FINENESS and np.prod(size / edge + 3.0) > most:
        edge *= 1.1
    return min(edge, cell_size / LEAST_FINENESS)


def require_solid(solid: Solid, size: FloatArray, within: float, cell_size: float) -> None:
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
