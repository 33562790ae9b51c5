"""CMPM2: barycentric subfaces instead of the Voronoi graph (thesis section 4.4.1).

The normal n of an edge's subfaces is compared with r, the rest direction of n as carried by the tetrahedra:
eq. 4.9 (with r - n^, of unit length) and 4.10. If several tetrahedra share an edge, r is the mean of their
directions, weighted by the areas of their subfaces. Implicit Euler keeps n fixed, and uses the edge itself as
r (`bond_stiffness`).
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
        a, b: the other two vertices of the tetrahedron, counterclockwise against the edge's direction [m].
    """
    return (a - center).cross(b - center) / 12.0


def carried_direction(rings: EdgeRings, directions: Floats) -> Floats:
    """Weights (r, 3) of an edge's far end and of the two sides of a subface in the carried direction.

    In each tetrahedron, a direction d at rest becomes F d = sum (A^-1 d)_i (x_i - x_0) (eq. 6.3), here with
    the edge's first end as x_0. Summed over the rows of an edge, the weights give the weighted
    mean over its tetrahedra.
    """
    mesh = rings.mesh
    x = mesh.vertices
    first, second = mesh.edges[rings.edge].T
    A = np.stack([x[i] - x[first] for i in (second, rings.sides[:, 0], rings.sides[:, 1])], axis=2)
    fraction = rings.areas / rings.edge_areas[rings.edge]
    return np.asarray(fraction[:, None] * np.linalg.solve(A, directions[rings.edge][:, :, None])[:, :, 0])


def require_tets(mesh: TetMesh, material: Material, law: str) -> EdgeRings:
    """Return the edge rings of a mesh. Raises: MeshError if it is not a TetMesh with a Material."""
    if not isinstance(mesh, TetMesh) or not isinstance(material, Material):
        raise MeshError(f"law {law!r} needs tetrahedra and a Material")
    return EdgeRings.of(mesh)


def cmpm2_bonds(mesh: TetMesh, material: Material) -> Bonds:
    """Return the bonds of a mesh. A ring row has the sides of a subface and `carried_direction` weights."""
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
