"""CMPM with the plane that best fits the particles around an edge (thesis section 4.4.2).

For more than three particles, the plane is a least-squares fit. For three particles, the same formula gives
the plane through them. For two particles, the centre of the edge is the third point. Such planes are rarely
perpendicular to their edge. As in CMPM2, the law therefore compares the normal with the carried direction:
the normal at rest, transformed by the tetrahedra. Implicit Euler keeps the normal fixed and compares the
normal with the edge itself (`bond_stiffness`).
"""

from __future__ import annotations

import numpy as np

from taichi_soft.core.math.eigen import symmetric_eigen
from taichi_soft.core.runtime import ti
from taichi_soft.elements.laws.bonds import Bonds, Floats, columns, member_columns
from taichi_soft.elements.laws.cmpm import moduli
from taichi_soft.elements.laws.cmpm2 import carried_direction, require_tets
from taichi_soft.elements.materials import Material
from taichi_soft.meshing import EdgeRings, TetMesh


@ti.func
def plane_normal(count, total, squares, r):
    """Unit normal of the plane that best fits a set of points. Its component along `r` is not negative.

    Args:
        count: number of points.
        total: sum of the points, vec3 [m].
        squares: sum of the outer squares of the points, as columns [m^2].
        r: second end of the edge minus the first [m].
    """
    mean = total / count
    spread = (
        squares[0] - total * mean.x,
        squares[1] - total * mean.y,
        squares[2] - total * mean.z,
    )
    _, axes = symmetric_eigen(spread)
    return axes[2] * ti.select(axes[2].dot(r) < 0.0, -1.0, 1.0)


def plane_normals(rings: EdgeRings) -> Floats:
    """Unit normal of the best-fitting plane of every edge at rest, (k, 3), in NumPy."""
    mesh = rings.mesh
    edge, vertex = rings.neighbours
    ends = mesh.vertices[mesh.edges]
    offset = mesh.vertices[vertex] - ends[edge].mean(axis=1)
    start = np.searchsorted(edge, np.arange(len(mesh.edges)))
    count = np.maximum(np.bincount(edge), 3)[:, None]  # if only two, the edge's centre is the third point
    total = np.add.reduceat(offset, start, axis=0)
    squares = np.add.reduceat(offset[:, :, None] * offset[:, None, :], start, axis=0)
    _, axes = np.linalg.eigh(squares - total[:, :, None] * (total / count)[:, None, :])
    side = np.einsum("ka,ka->k", axes[:, :, 0], ends[:, 1] - ends[:, 0])
    return np.asarray(axes[:, :, 0] * np.where(side < 0, -1.0, 1.0)[:, None])


def carried_by_ring(rings: EdgeRings, normals: Floats) -> tuple[Floats, Floats]:
    """Return the weights from which the carried direction of an edge is computed.

    The carried direction is the direction at rest in `normals`, transformed by the tetrahedra
    (`carried_direction`). It is the weighted sum over the rows of an edge in `rings.neighbours`.
    Returns: weight of the particle of each row, (s,), and weight of the edge's second end, (s,).
    """
    far, one, other = carried_direction(rings, normals).T
    edge, vertex = rings.neighbours
    count = len(rings.mesh.vertices)
    keys = edge * count + vertex
    weight = np.zeros(len(keys))
    order = np.argsort(keys)
    for side, weights in zip(rings.sides.T, (one, other), strict=True):
        np.add.at(weight, order[np.searchsorted(keys[order], rings.edge * count + side)], weights)
    return weight, np.asarray((rings.sum(far) / np.bincount(edge))[edge])


def best_fitting_plane_bonds(mesh: TetMesh, material: Material) -> Bonds:
    """Return the bonds of a mesh. Each ring row has a particle and two weights from `carried_by_ring`."""
    rings = require_tets(mesh, material, "best_fitting_plane")
    normals = plane_normals(rings)
    weight, far_weight = carried_by_ring(rings, normals)
    edge, vertex = rings.neighbours
    young, shear, damping = moduli(rings, material)
    area = rings.edge_areas
    return Bonds(
        columns(1.0, area * young, area * shear, damping, count=len(mesh.edges)),
        edge,
        member_columns(vertex, count=len(edge)),
        columns(weight, far_weight, count=len(edge)),
        normals,
    )
