"""CMPM2: barycentric subfaces instead of the Voronoi graph (thesis section 4.4.1).

The law compares the unit normal n of an edge's subfaces with the carried direction r (eq. 4.9 and 4.10). r is
the normal at rest, transformed by the tetrahedra. If several tetrahedra share an edge, r is the mean of their
directions, weighted by the areas of their subfaces. Eq. 4.9 prints r - n without normalising n. Implicit
Euler keeps n fixed, and uses the edge itself as r (`bond_stiffness`).
"""

from __future__ import annotations

import numpy as np

from taichi_soft.core.errors import MeshError
from taichi_soft.core.runtime import ti
from taichi_soft.elements.laws.bonds import Bonds, Floats, columns, member_columns
from taichi_soft.elements.laws.cmpm import moduli
from taichi_soft.elements.materials import Material
from taichi_soft.meshing import EdgeRings, TetMesh


@ti.func
def subface(center, a, b):
    """Area vector of a barycentric subface [m^2], along its edge (fig. 4.4).

    Args:
        center: centre of the edge [m].
        a, b: the other two vertices of the tetrahedron, counterclockwise if seen from the second end [m].
    """
    return (a - center).cross(b - center) / 12.0


def carried_direction(rings: EdgeRings, directions: Floats) -> Floats:
    """Return the weights from which the carried direction of an edge is computed, (r, 3).

    Each row has the weights of the edge's second end and of the two sides of the subface.

    A tetrahedron transforms a direction d at rest to F d = sum (A^-1 d)_i (x_i - x_0) (eq. 6.3). Here, x_0 is
    the edge's first end. The sum over the rows of an edge is the carried direction: the mean of F d over the
    tetrahedra, weighted by the areas of their subfaces.
    """
    mesh = rings.mesh
    x = mesh.vertices
    first, second = mesh.edges[rings.edge].T
    A = np.stack([x[i] - x[first] for i in (second, rings.sides[:, 0], rings.sides[:, 1])], axis=2)
    fraction = rings.areas / rings.edge_areas[rings.edge]
    return np.asarray(fraction[:, None] * np.linalg.solve(A, directions[rings.edge][:, :, None])[:, :, 0])


def require_tets(mesh: TetMesh, material: Material, law: str) -> EdgeRings:
    """Return the edge rings of a mesh.

    Raises: MeshError if `mesh` is not a TetMesh, or `material` is not a Material.
    """
    if not isinstance(mesh, TetMesh) or not isinstance(material, Material):
        raise MeshError(f"law {law!r} needs tetrahedra and a Material")
    return EdgeRings.of(mesh)


def cmpm2_bonds(mesh: TetMesh, material: Material) -> Bonds:
    """Return the bonds of a mesh.

    Each ring row has the two sides of a subface, and the weights from `carried_direction`.
    """
    rings = require_tets(mesh, material, "cmpm2")
    normals = rings.sum(rings.area_vectors)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    far, one, other = carried_direction(rings, normals).T
    young, shear, damping = moduli(rings, material)
    area = rings.edge_areas
    rows = len(rings.edge)
    return Bonds(
        columns(1.0, area * young, area * shear, damping, count=len(mesh.edges)),
        rings.edge,
        member_columns(*rings.sides.T, count=rows),
        columns(one, other, far, count=rows),
        normals,
    )
