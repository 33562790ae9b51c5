"""CMPM with the plane that fits the particles round an edge best (thesis section 4.4.2).

Least squares for more than three particles; the same formula gives the cross product for three. Where there
are two, the centre of the edge is the third. Such planes are rarely perpendicular to their edge, so, as in
CMPM2, their normal is compared with where the tetrahedra have carried it from rest. Implicit Euler holds the
normal, and takes the edge itself for what is compared (`bond_stiffness`).
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
    """Unit normal of the plane through points, on the side of `r`.

    Args:
        count: of the points.
        total: their sum, vec3 [m].
        squares: sum of their outer squares, as columns [m^2].
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
    """`plane_normal` of every edge at rest, in numpy, (k, 3)."""
    mesh = rings.mesh
    edge, vertex = rings.neighbours
    ends = mesh.vertices[mesh.edges]
    arm = mesh.vertices[vertex] - ends[edge].mean(axis=1)
    start = np.searchsorted(edge, np.arange(len(mesh.edges)))
    count = np.maximum(np.bincount(edge), 3)[:, None]  # of two, the centre of the edge is the third
    total = np.add.reduceat(arm, start, axis=0)
    squares = np.add.reduceat(arm[:, :, None] * arm[:, None, :], start, axis=0)
    _, axes = np.linalg.eigh(squares - total[:, :, None] * (total / count)[:, None, :])
    side = np.einsum("ka,ka->k", axes[:, :, 0], ends[:, 1] - ends[:, 0])
    return np.asarray(axes[:, :, 0] * np.where(side < 0, -1.0, 1.0)[:, None])


def split_ring_normals(rings: EdgeRings) -> Floats:
    """The cheap normals of 4.4.2 at rest, (k, 3): no eigenvectors, nothing but sums.

    The particles round an edge are split into two halves, and once more a quarter of a turn further. The
    normal is that of the two vectors between the means of the halves; of three particles it is the plane's.
    """
    mesh = rings.mesh
    edge, vertex = rings.neighbours
    ends = mesh.vertices[mesh.edges]
    arm = mesh.vertices[vertex] - ends[edge].mean(axis=1)
    start = np.searchsorted(edge, np.arange(len(mesh.edges)))
    number, count = np.arange(len(edge)) - start[edge], np.maximum(np.bincount(edge), 3)[edge]
    half = count // 2
    spans = []
    for turn in (0 * count, np.maximum(1, np.rint(count / 4).astype(np.int64))):
        weight = np.where((number - turn) % count < half, 1 / half, -1 / (count - half))
        spans.append(np.add.reduceat(weight[:, None] * arm, start, axis=0))
    normals = np.cross(*spans)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    side = np.einsum("ka,ka->k", normals, ends[:, 1] - ends[:, 0])
    return np.asarray(normals * np.where(side < 0, -1.0, 1.0)[:, None])


def best_fitting_plane_bonds(mesh: TetMesh, material: Material) -> Bonds:
    """Ring rows: a particle; its weight, and a share of the far end's, in the carried direction."""
    rings = require_tets(mesh, material, "best_fitting_plane")
    normals = plane_normals(rings)
    far, one, other = carried_direction(rings, normals).T
    edge, vertex = rings.neighbours
    count = len(mesh.vertices)
    keys = edge * count + vertex
    weight = np.zeros(len(keys))
    order = np.argsort(keys)
    for side, part in zip(rings.sides.T, (one, other), strict=True):
        np.add.at(weight, order[np.searchsorted(keys[order], rings.edge * count + side)], part)
    share = (rings.sum(far) / np.bincount(edge))[edge]
    young, shear, damping = moduli(rings, material)
    area = rings.edge_areas
    return Bonds(
        columns(1.0, area * young, area * shear, damping, count=len(mesh.edges)),
        edge,
        member_columns(vertex, count=len(edge)),
        columns(weight, share, count=len(edge)),
        normals,
    )
