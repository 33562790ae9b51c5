"""CMPM with a normal from two splits of the ring of particles around an edge (thesis section 4.4.2).

The thesis considers this normal because it needs no eigenvectors. The ring is split into two halves, and then
split again a quarter of the ring further. Each split gives the vector between the mean positions of its two
halves. The normal is the cross product of the two vectors. If the ring has only two particles, the centre of
the edge is the third point.

As in CMPM2, the law compares the normal with the carried direction: the normal at rest, transformed by the
tetrahedra. The order of the particles determines the sign of the normal, so that the normal stays continuous
if an edge is turned inside out. Implicit Euler keeps the normal fixed and compares the normal with the edge
itself (`bond_stiffness`).
"""

from __future__ import annotations

import numpy as np

from taichi_soft.core.errors import MeshError
from taichi_soft.elements.laws.best_fitting_plane import carried_by_ring
from taichi_soft.elements.laws.bonds import Bonds, Floats, columns, member_columns
from taichi_soft.elements.laws.cmpm import moduli
from taichi_soft.elements.laws.cmpm2 import require_tets
from taichi_soft.elements.materials import Material
from taichi_soft.meshing import EdgeRings, TetMesh

FLAT = 1e-6
"""Lower limit of the sine of the angle between the two vectors. Below this limit, rounding errors would
determine the normal."""


def split_weights(rings: EdgeRings) -> tuple[Floats, Floats]:
    """Return the weights of the particles in the vectors of the first and of the second split, (s,) each.

    Each weight belongs to a row of `rings.neighbours`.
    """
    edge, _ = rings.neighbours
    start = np.searchsorted(edge, np.arange(len(rings.mesh.edges)))
    index = np.arange(len(edge)) - start[edge]
    count = np.maximum(np.bincount(edge), 3)[edge]  # with two particles, the edge's centre is the third point
    half = count // 2
    quarter = np.maximum(1, np.rint(count / 4).astype(np.int64))

    def between(shift: Floats) -> Floats:
        return np.where((index - shift) % count < half, 1 / half, -1 / (count - half))

    return between(np.zeros_like(quarter)), between(quarter)


def split_ring_plane_bonds(mesh: TetMesh, material: Material) -> Bonds:
    """Return the bonds of a mesh. Each ring row has a particle, and its weights for the carried direction
    (`carried_by_ring`) and for the two splits (`split_weights`).

    Raises: MeshError if the two vectors of an edge are parallel, so that they span no plane.
    """
    rings = require_tets(mesh, material, "split_ring_plane")
    edge, vertex = rings.neighbours
    ends = mesh.vertices[mesh.edges]
    offset = mesh.vertices[vertex] - ends[edge].mean(axis=1)
    start = np.searchsorted(edge, np.arange(len(mesh.edges)))
    one, other = split_weights(rings)
    spans = [np.add.reduceat(weight[:, None] * offset, start, axis=0) for weight in (one, other)]
    normals = np.cross(*spans)
    length = np.linalg.norm(normals, axis=1)
    flat = np.flatnonzero(length <= FLAT * np.linalg.norm(spans, axis=2).prod(axis=0))
    if len(flat):
        p, q = mesh.edges[flat[0]]
        raise MeshError(
            f"law 'split_ring_plane' finds no plane across edge {flat[0]} (vertices {p}, {q}): the halves of "
            "its ring lie in one line. Use law='best_fitting_plane'."
        )
    normals /= length[:, None]
    # In a wide ring, the normal can point against the edge. The weights of one split correct its sign.
    sign = np.where(np.einsum("ka,ka->k", normals, ends[:, 1] - ends[:, 0]) < 0, -1.0, 1.0)
    normals *= sign[:, None]
    weight, far_weight = carried_by_ring(rings, normals)
    young, shear, damping = moduli(rings, material)
    area = rings.edge_areas
    return Bonds(
        columns(1.0, area * young, area * shear, damping, count=len(mesh.edges)),
        edge,
        member_columns(vertex, count=len(edge)),
        columns(weight, far_weight, one * sign[edge], other, count=len(edge)),
        normals,
    )
