"""Rings of edges in a tetrahedral mesh: the tetrahedra that share an edge, and their other vertices."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.tet_mesh import TetMesh
from taichi_soft.meshing.topology import LOCAL_EDGES

Ints = NDArray[np.int64]

OPPOSITE = np.array([(2, 3), (3, 1), (1, 2), (0, 3), (2, 0), (0, 1)])
"""The other two vertices of each of `LOCAL_EDGES`, counterclockwise when the edge points at the viewer."""


@dataclass(frozen=True, eq=False)
class EdgeRings:
    """The tetrahedra around every edge, edge by edge.

    Attributes:
        mesh: the mesh.
        edge: (r,) row of `mesh.edges`, ascending.
        tet: (r,) tetrahedron that contains the edge.
        sides: (r, 2) other two vertices of `tet`, counterclockwise if the edge i -> j points at the viewer.
    """

    mesh: TetMesh
    edge: Ints
    tet: Ints
    sides: Ints

    @classmethod
    def of(cls, mesh: TetMesh) -> EdgeRings:
        """Find the rings of a mesh."""
        ends, sides = mesh.tets[:, LOCAL_EDGES], mesh.tets[:, OPPOSITE]
        turned = ends[..., 0] > ends[..., 1]  # against the direction in which the edge is stored
        sides[turned] = sides[turned][:, ::-1]
        order = np.argsort(mesh.tet_edges.ravel(), kind="stable")
        return cls(
            mesh,
            mesh.tet_edges.ravel()[order].astype(np.int64),
            order // 6,
            sides.reshape(-1, 2)[order].astype(np.int64),
        )

    @cached_property
    def area_vectors(self) -> FloatArray:
        """Area vector of each edge's barycentric subface in each of its tetrahedra, (r, 3) [m^2].

        The subface (thesis 4.4.1) is the quadrilateral between the centres of the edge, its two faces and the
        tetrahedron. Its area vector is (a - m) x (b - m) / 12, with the edge's centre m and `sides` a, b.
        """
        x = self.mesh.vertices
        center = x[self.mesh.edges[self.edge]].mean(axis=1)
        a, b = (x[self.sides[:, i]] - center for i in (0, 1))
        return np.asarray(np.cross(a, b) / 12.0)

    @cached_property
    def areas(self) -> FloatArray:
        """Areas of the subfaces, (r,) [m^2]."""
        return np.asarray(np.linalg.norm(self.area_vectors, axis=1))

    @cached_property
    def edge_areas(self) -> FloatArray:
        """Total area of the subfaces of each edge, (k,) [m^2]."""
        return self.sum(self.areas)

    def sum(self, rows: FloatArray) -> FloatArray:
        """Sum values per row, (r,) or (r, c), over the tetrahedra around each edge."""
        start = np.searchsorted(self.edge, np.arange(len(self.mesh.edges)))
        return np.asarray(np.add.reduceat(rows, start, axis=0))

    def mean(self, per_tet: FloatArray) -> FloatArray:
        """Mean of values per tetrahedron (m,) around each edge, weighted by subface area, (k,)."""
        return self.sum(self.areas * per_tet[self.tet]) / self.edge_areas

    @cached_property
    def neighbours(self) -> tuple[Ints, Ints]:
        """Vertices around each edge, each once: rows of edges (s,) ascending, and vertices (s,).

        The vertices of an edge run counterclockwise, seen against its direction (thesis 4.4.3).
        """
        pairs = np.unique(np.stack([np.repeat(self.edge, 2), self.sides.ravel()], axis=1), axis=0)
        edge, vertex = pairs.T
        x = self.mesh.vertices
        ends = x[self.mesh.edges[edge]]
        axis = ends[:, 1] - ends[:, 0]
        axis /= np.linalg.norm(axis, axis=1, keepdims=True)
        first = x[vertex[np.searchsorted(edge, edge)]] - ends[:, 0]
        first -= np.einsum("ka,ka->k", first, axis)[:, None] * axis
        arm = x[vertex] - ends[:, 0]
        angle = np.arctan2(
            np.einsum("ka,ka->k", np.cross(axis, first), arm), np.einsum("ka,ka->k", first, arm)
        )
        # Rounded, because round-off can put the first vertex of an edge just below a full turn.
        order = np.lexsort((np.round(angle, 9) % (2 * np.pi), edge))
        return edge[order], vertex[order]
