"""Deviation of the planes of CMPM and its variants from perpendicular to their edges (thesis fig. 4.7)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.checks import as_flag
from taichi_soft.core.errors import MeshError, OptionError
from taichi_soft.elements.laws import LAWS, BondLaw
from taichi_soft.elements.laws.best_fitting_plane import split_ring_normals
from taichi_soft.elements.materials import Material
from taichi_soft.meshing import EdgeRings, TetMesh


def plane_angles(mesh: TetMesh, law: str, *, is_split: bool = False) -> NDArray[np.float64]:
    """Return the angle at rest between each edge and the normal of its plane, (k,) [degrees].

    It is NaN for edges without a bond.

    This normal separates the strain of an edge into tension and shear: the larger the angle, the more of a
    tension counts as shear. Faces of the Voronoi graph and tilted planes are perpendicular by construction.
    Args:
        law: one of chapter 4, such as "cmpm2" or "best_fitting_plane".
        is_split: for "best_fitting_plane": use the cheap normals that section 4.4.2 considers, across the
            lines between the means of the halves of a ring that is split twice.
        mesh: rest shape.
    Raises: OptionError for another law; MeshError if `mesh` is not a TetMesh, or not Delaunay for "cmpm".
    """
    if not isinstance(mesh, TetMesh):
        raise MeshError(f"mesh must be a TetMesh, got {type(mesh).__name__}")
    chosen = LAWS.get(law) if isinstance(law, str) else None
    if not isinstance(chosen, BondLaw) or not chosen.takes_shear:
        names = ", ".join(
            repr(each.name) for each in LAWS.values() if isinstance(each, BondLaw) and each.takes_shear
        )
        raise OptionError(f"law {law!r} has no planes: choose one of {names}")
    if as_flag(is_split, "is_split") and law != "best_fitting_plane":
        raise OptionError(f"law {law!r} has no planes that can be split: leave out is_split")
    material = Material(young=1.0, poisson=0.0, density=1.0)
    normals = split_ring_normals(EdgeRings.of(mesh)) if is_split else chosen.bonds(mesh, material).normals
    assert normals is not None
    ends = mesh.vertices[mesh.edges]
    along = np.einsum("ka,ka->k", normals, ends[:, 1] - ends[:, 0]) / mesh.edge_lengths
    return np.asarray(np.degrees(np.arccos(np.clip(along, -1.0, 1.0))))
