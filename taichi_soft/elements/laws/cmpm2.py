"""CMPM2: barycentric subfaces instead of the Voronoi graph (thesis section 4.4.1).

The normal n of an edge's subfaces is compared with r, the direction that it had at rest as carried along by
the
tetrahedra: eq. 4.9 (with r - n^, of unit length) and 4.10. On an edge that several tetrahedra share, r is
their mean, weighted by the areas of their subfaces. Implicit Euler keeps n fixed, and uses the edge itself
for r (`bond_stiffness`).
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
    """Weights (r, 3) of an edge's far end and of the two sides in its carried direction.

    A direction d at rest becomes F d = sum (A^-1 d)_i (x_i - x_0) in each tetrahedron (eq. 6.3), here with
    the edge's first end as x_0; summed over the rows of an edge, these give the means of the law.
    """
    mesh = rings.mesh
    x = mesh.vertices
    first, second = mesh.edges[rings.edge].T
    A = np.stack([x[i] - x[first] for i in (second, rings.sides[:, 0], rings.sides[:, 1])], axis=2)
    fraction = rings.areas / rings.edge_areas[rings.edge]
    return np.asarray(fraction[:, None] * np.linalg.solve(A, directions[rings.edge][:, :, None])[:, :, 0])


def require_tets(mesh: TetMesh, material: Material, law: str) -> EdgeRings:
    """Return the rings of a tetrahedral mesh. Raises: MeshError for another mesh or material."""
    if not isinstance(mesh, TetMesh) or not isinstance(material, Material):
        raise MeshError(f"law {law!r} needs tetrahedra and a Material")
    return EdgeRings.of(mesh)


def cmpm2_bonds(mesh: TetMesh, material: Material) -> Bonds:
    """Ring rows: the two sides of a subface; the weights of both and of the far end in the direction r."""
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
