"""Meshes of tetrahedra that fill a volume, with their particles and edges."""

from __future__ import annotations

from functools import cached_property
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.core.checks import as_positive
from taichi_soft.core.errors import MeshError
from taichi_soft.core.serialisation import serialised
from taichi_soft.meshing.arrays import FloatArray, IntArray, as_indices, as_points, name_vertices, read_only
from taichi_soft.meshing.body_mesh import BodyMesh
from taichi_soft.meshing.improvement import improve
from taichi_soft.meshing.quality import FLATTEST, MeshQuality, measure_quality
from taichi_soft.meshing.topology import LOCAL_EDGES, edges_of, first_duplicate, surface_of


@serialised("vertices", "tets")
class TetMesh(BodyMesh):
    """A tetrahedral mesh, validated once and immutable.

    Args:
        vertices: (n, 3) positions at rest [m].
        tets: (m, 4) integer vertex indices. A tetrahedron has positive volume if
            det[x1-x0, x2-x0, x3-x0] > 0.
        fix_orientation: reverse tetrahedra of negative volume by swapping their last two vertices.

    Attributes:
        vertices: float64 (n, 3) [m].
        tets: int32 (m, 4), in the order of the argument.
        edges: int32 (k, 2), vertex indices (i, j) with i < j. Rows are in ascending order.
        tet_edges: int32 (m, 6), rows of `edges` for the edges (0,1), (0,2), (0,3), (1,2), (1,3), (2,3) of
            each tetrahedron.
        surface: int32 (f, 3), boundary triangles, counterclockwise seen from outside.
        volumes: float64 (m,), volume of each tetrahedron, all positive [m^3].
        fill: float64 (m,), fraction of each tetrahedron that is solid. It is 1 except in a `CageMesh`.

    Raises: MeshError, which names the element, for wrong shapes or dtypes, numbers that are not finite,
        indices out of range, a tetrahedron that uses a vertex twice, a duplicate tetrahedron, a tetrahedron
        of zero volume (relative to its longest edge) or negative volume, a vertex without a tetrahedron, a
        face of more than two tetrahedra, neighbours that overlap, or an empty mesh.

    The arrays are copied. A mesh can have several components that do not touch.
    """

    tet_edges: IntArray
    surface: IntArray
    volumes: FloatArray

    def __init__(self, vertices: ArrayLike, tets: ArrayLike, *, fix_orientation: bool = False) -> None:
        points = as_points(vertices)
        corners = as_indices(tets, "tets", 4, len(points), "tetrahedron")
        duplicate = first_duplicate(corners)
        if duplicate is not None:
            raise MeshError(
                f"tetrahedra {duplicate[0]} and {duplicate[1]} have the same vertices "
                f"({name_vertices(corners[duplicate[0]])}): remove one of them"
            )
        volumes = _checked_volumes(points, corners, fix_orientation)
        turned = volumes < 0
        corners[turned] = corners[turned][:, [0, 1, 3, 2]]
        _reject_unused(len(points), corners)
        self._initialise(points, corners, np.abs(volumes))

    def _initialise(self, points: FloatArray, corners: IntArray, volumes: FloatArray) -> None:
        surface = surface_of(corners)
        edges, tet_edges = edges_of(corners)
        super().__init__(points, edges, corners)
        self.__dict__.update(
            tet_edges=read_only(tet_edges), surface=read_only(surface), volumes=read_only(volumes)
        )

    def part(self, vertices: NDArray[Any], tets: IntArray, rows: NDArray[Any]) -> TetMesh:
        """Return a mesh of some of the tetrahedra, for example after a cut. The new mesh is not validated.

        Args:
            vertices: vertex of this mesh that each new vertex copies, (n,).
            tets: tetrahedra of the new mesh, as indices of new vertices, (m, 4). They must use all vertices.
            rows: tetrahedron of this mesh that each new tetrahedron copies, (m,).
        """
        mesh = type(self).__new__(type(self))
        mesh._initialise(self.vertices[vertices], tets, self.volumes[rows])
        mesh._inherit(self, vertices, rows)
        return mesh

    def _inherit(self, original: TetMesh, vertices: NDArray[Any], rows: NDArray[Any]) -> None:
        """Copy data other than geometry from `original` to this mesh, which is a part of `original`.

        The arguments `vertices` and `rows` are those of `part`.
        """

    def __reduce__(self) -> tuple[Any, ...]:
        # Copying and unpickling rebuild the mesh, so that its arrays are read-only again.
        return (TetMesh, (self.vertices, self.tets))

    def __repr__(self) -> str:
        return f"TetMesh({len(self.vertices)} vertices, {len(self.tets)} tetrahedra, {self.volume:.6g} m^3)"

    def _with_vertices(self, vertices: FloatArray) -> TetMesh:
        return TetMesh(vertices, self.tets)

    @overload
    def improved(
        self,
        *,
        min_size: float | None = ...,
        tolerance: float | None = ...,
        return_source: Literal[False] = ...,
    ) -> TetMesh: ...

    @overload
    def improved(
        self, *, min_size: float | None = ..., tolerance: float | None = ..., return_source: Literal[True]
    ) -> tuple[TetMesh, IntArray]: ...

    def improved(
        self, *, min_size: float | None = None, tolerance: float | None = None, return_source: bool = False
    ) -> TetMesh | tuple[TetMesh, IntArray]:
        """Return the same body without the tetrahedra that force the smallest time steps.

        These tetrahedra are flipped, reshaped or collapsed. The size of a tetrahedron is the edge length of a
        regular tetrahedron with the same sum of squared gradients of the shape functions. The stable step
        grows with the smallest size in the mesh. The smallest size never decreases, components and holes
        stay, and the result is the same on every run. Small tetrahedra remain if the surface allows no
        change.
        Args:
            min_size: size below which a tetrahedron is improved [m]; None for 0.3 of the median size.
            tolerance: largest displacement of the surface [m]; None for a quarter of the mean edge, but at
                most 1 % of the diagonal of the bounding box. The volume changes by at most 1 % in any case.
            return_source: True to return also `source`, int32 (m,), the tetrahedron of this mesh that each
                new tetrahedron replaces. `values[source]` transfers values per tetrahedron to the new mesh. A
                border between materials can shift by a few tetrahedra.
        Returns: the improved mesh, or this mesh itself if nothing was improved.
        Raises: OptionError if min_size or tolerance is not positive.
        """
        if tolerance is None:
            tolerance = min(
                0.25 * self.edge_lengths.mean(), 0.01 * np.linalg.norm(np.ptp(self.bounds, axis=0))
            )
        better = improve(
            self.vertices,
            self.tets,
            self.surface,
            size=None if min_size is None else as_positive(min_size, "min_size", "m"),
            tolerance=as_positive(tolerance, "tolerance", "m"),
        )
        mesh = self if better is None else TetMesh(better.vertices, better.tets)
        if not return_source:
            return mesh
        return mesh, np.arange(len(self.tets), dtype=np.int32) if better is None else better.source

    @property
    def volume(self) -> float:
        """Volume of the mesh [m^3]."""
        return float(self.volumes.sum())

    @cached_property
    def fill(self) -> FloatArray:
        """Fraction of each tetrahedron that is solid, float64 (m,). It is 1 except in a `CageMesh`."""
        return read_only(np.ones(len(self.tets)))

    @cached_property
    def vertex_volumes(self) -> FloatArray:
        """Volume of each particle, float64 (n,) [m^3]: a quarter of the tetrahedra around the particle."""
        sums = np.bincount(self.tets.ravel(), np.repeat(self.volumes / 4.0, 4), len(self.vertices))
        volumes: FloatArray = read_only(sums)
        return volumes

    @cached_property
    def edge_valence(self) -> IntArray:
        """Number of tetrahedra that share each edge, int32 (k,)."""
        valence: IntArray = read_only(np.bincount(self.tet_edges.ravel()).astype(np.int32))
        return valence

    @cached_property
    def surface_vertices(self) -> IntArray:
        """Indices of the vertices on the surface, ascending, int32."""
        indices: IntArray = read_only(np.unique(self.surface))
        return indices

    @cached_property
    def quality(self) -> MeshQuality:
        """Angles, aspect ratios and edge lengths. `mesh.quality.summary()` describes them in one line."""
        return measure_quality(self.vertices, self.tets)


def _checked_volumes(points: FloatArray, tets: IntArray, allow_negative: bool) -> FloatArray:
    """Return signed volumes, (m,) [m^3].

    Raises: MeshError for flat tetrahedra, and for inverted tetrahedra unless `allow_negative` is True.
    """
    corners = points[tets]
    a, b, c = (corners[:, i] - corners[:, 0] for i in (1, 2, 3))
    volumes: FloatArray = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
    ends = corners[:, LOCAL_EDGES]
    longest = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2).max(axis=1)
    # The comparison is negated so that a tetrahedron also counts as flat if both sides underflow to 0.
    flat = ~(np.abs(volumes) > FLATTEST * longest**3)
    if flat.any():
        row = int(np.argmax(flat))
        raise MeshError(
            f"tetrahedron {row} has no volume ({volumes[row]:.2g} m^3 with a longest edge of "
            f"{longest[row]:.2g} m, vertices {name_vertices(tets[row])}): remove it or repair the mesh"
        )
    if not allow_negative and (volumes < 0).any():
        row = int(np.argmax(volumes < 0))
        raise MeshError(
            f"tetrahedron {row} has volume {volumes[row]:.2g} m^3 (vertices {name_vertices(tets[row])}): "
            "pass fix_orientation=True or repair the mesh"
        )
    return volumes


def _reject_unused(vertex_count: int, tets: IntArray) -> None:
    uses = np.bincount(tets.ravel(), minlength=vertex_count)
    if (uses == 0).any():
        unused = np.flatnonzero(uses == 0)
        raise MeshError(
            f"vertex {unused[0]} belongs to no tetrahedron ({len(unused)} such vertices): remove them, "
            "a particle without volume has no mass"
        )
