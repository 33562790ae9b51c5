"""Rings of edges in a mesh. A ring has the tetrahedra that share an edge, and their other vertices."""

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
"""For each of `LOCAL_EDGES`, the tetrahedron's other two vertices, counterclockwise if the edge points at the
viewer."""


@dataclass(frozen=True, eq=False)
class EdgeRings:
    """The tetrahedra around every edge of a mesh, one row for each edge of each tetrahedron.

    Attributes:
        mesh: the mesh.
        edge: (r,) row of `mesh.edges`, ascending.
        tet: (r,) tetrahedron that contains the edge.
        sides: (r, 2) the tetrahedron's other two vertices, counterclockwise if the edge i -> j points at the
            viewer.
    """

    mesh: TetMesh
    edge: Ints
    tet: Ints
    sides: Ints

    @classmethod
    def of(cls, mesh: TetMesh) -> EdgeRings:
        """Find the rings of a mesh."""
        ends, sides = mesh.tets[:, LOCAL_EDGES], mesh.tets[:, OPPOSITE]
        turned = ends[..., 0] > ends[..., 1]  # True if the mesh stores the edge in the other direction
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
        """For each row, the area vector of the edge's barycentric subface in the tetrahedron, (r, 3) [m^2].

        The subface (thesis 4.4.1) is the quadrilateral between the centres of the edge, its two faces and the
        tetrahedron. The area vector is (a - m) x (b - m) / 12, where m is the edge's centre and a, b are the
        `sides`.
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
        """Sum values over the tetrahedra around each edge, (k,) or (k, c).

        Args: rows: values for each row, (r,) or (r, c).
        """
        start = np.searchsorted(self.edge, np.arange(len(self.mesh.edges)))
        return np.asarray(np.add.reduceat(rows, start, axis=0))

    def mean(self, per_tet: FloatArray) -> FloatArray:
        """Return the mean of values over the tetrahedra around each edge, weighted by subface area, (k,).

        Args: per_tet: value for each tetrahedron, (m,).
        """
        return self.sum(self.areas * per_tet[self.tet]) / self.edge_areas

    @cached_property
    def neighbours(self) -> tuple[Ints, Ints]:
        """Vertices around each edge, without repetition: the edge, ascending, (s,), and the vertex, (s,).

        The vertices around an edge run counterclockwise if the edge points at the viewer (thesis 4.4.3).
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
        # Rounded, because rounding errors can make the angle of an edge's first vertex slightly negative.
        order = np.lexsort((np.round(angle, 9) % (2 * np.pi), edge))
        return edge[order], vertex[order]
