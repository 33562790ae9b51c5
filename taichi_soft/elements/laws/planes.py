"""Angles between edges and the normals of their planes in CMPM and its variants (thesis fig. 4.7)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import MeshError, OptionError
from taichi_soft.elements.laws import LAWS, BondLaw
from taichi_soft.elements.materials import Material
from taichi_soft.meshing import TetMesh


def plane_angles(mesh: TetMesh, law: str) -> NDArray[np.float64]:
    """Return the angle at rest between each edge and the normal of its plane, (k,) [degrees].

    The angle is NaN for edges without a bond.

    The normal splits the strain of an edge into tension and shear. The larger the angle, the larger the part
    of a tension that counts as shear. Voronoi faces and tilted planes are perpendicular to their edges by
    construction.
    Args:
        mesh: rest shape.
        law: name of a law of chapter 4, such as "cmpm2" or "best_fitting_plane".
    Raises: OptionError for a law without planes; MeshError if `mesh` is not a TetMesh, or is not Delaunay for
        "cmpm".
    """
    if not isinstance(mesh, TetMesh):
        raise MeshError(f"mesh must be a TetMesh, got {type(mesh).__name__}")
    chosen = LAWS.get(law) if isinstance(law, str) else None
    if not isinstance(chosen, BondLaw) or not chosen.takes_shear:
        names = ", ".join(
            repr(each.name) for each in LAWS.values() if isinstance(each, BondLaw) and each.takes_shear
        )
        raise OptionError(f"law {law!r} has no planes: choose one of {names}")
    material = Material(young=1.0, poisson=0.0, density=1.0)
    normals = chosen.bonds(mesh, material).normals
    assert normals is not None
    ends = mesh.vertices[mesh.edges]
    along = np.einsum("ka,ka->k", normals, ends[:, 1] - ends[:, 0]) / mesh.edge_lengths
    return np.asarray(np.degrees(np.arccos(np.clip(along, -1.0, 1.0))))
