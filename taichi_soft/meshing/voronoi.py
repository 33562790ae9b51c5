"""Voronoi graph of a Delaunay mesh, clipped by the surface of the body (thesis section 4.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import MeshError
from taichi_soft.core.math.barycentric import barycentric
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.delaunay import require_delaunay, scipy_spatial
from taichi_soft.meshing.polygons import Polygons
from taichi_soft.meshing.tet_mesh import TetMesh
from taichi_soft.meshing.topology import LOCAL_FACES

Ints = NDArray[np.int64]

PERTURBATION = 1e-9
"""Largest random shift of a Voronoi face, as a fraction of the shortest edge. Without this shift, faces in
regular meshes would coincide with faces of tetrahedra and would belong to both neighbours or to none."""

SMALLEST_FACE = 1e-7
"""Smallest valid area of a face, divided by the squared length of its edge. A smaller face is an artefact of
`PERTURBATION`."""


@dataclass(frozen=True, eq=False)
class VoronoiGraph:
    """Voronoi faces of the edges and Voronoi cells of the particles, clipped by the surface of the body.

    Attributes:
        areas: (k,) area of each edge's face [m^2]; 0 if the face is clipped away or does not exist.
        corner_edge: (c,) edge of each corner, ascending. The corners of an edge's face run right-handed
            around the direction i -> j of the edge, and the first corner is repeated at the end.
        corner_tet: (c,) a tetrahedron that contains the corner at rest.
        corner_weights: (c, 4) barycentric coordinates of the corner in that tetrahedron.
        cell_tet, cell_vertex, cell_volume: (s,) a tetrahedron, a vertex, and the volume of the
            part of the tetrahedron that is nearest to this vertex [m^3].
    """

    mesh: TetMesh
    areas: FloatArray
    corner_edge: Ints
    corner_tet: Ints
    corner_weights: FloatArray
    cell_tet: Ints
    cell_vertex: Ints
    cell_volume: FloatArray

    def masses(self, density: FloatArray) -> FloatArray:
        """Return the mass of each particle's cell, (n,) [kg].

        Args: density: density of each tetrahedron, (m,) [kg/m^3].
        """
        parts = self.cell_volume * density[self.cell_tet]
        return np.bincount(self.cell_vertex, parts, len(self.mesh.vertices)).astype(np.float64)

    def corners(self) -> FloatArray:
        """Return the positions of the corners at rest, (c, 3) [m]."""
        tets = self.mesh.vertices[self.mesh.tets[self.corner_tet]]
        return np.asarray(np.einsum("ci,cia->ca", self.corner_weights, tets))


def voronoi_graph(mesh: TetMesh) -> VoronoiGraph:
    """Return the clipped Voronoi graph of a mesh.

    The graph is computed once for each mesh. The computation takes about 1 s for 1,000 tetrahedra.
    Args:
        mesh: Delaunay mesh, such as `delaunay_mesh` returns.
    Raises: MeshError if the mesh is not Delaunay; OptionError if scipy is missing.
    """
    if not isinstance(mesh, TetMesh):
        raise MeshError(f"a Voronoi graph needs tetrahedra: pass a TetMesh, got {type(mesh).__name__}")
    cache = mesh.__dict__
    if "_voronoi_graph" not in cache:
        # Centre the mesh at the origin, because float64 has too few digits far from the origin.
        cache["_voronoi_graph"] = _graph_of(mesh, mesh.translated(-mesh.bounds.mean(axis=0)))
    graph: VoronoiGraph = cache["_voronoi_graph"]
    return graph


def _graph_of(original: TetMesh, mesh: TetMesh) -> VoronoiGraph:
    require_delaunay(mesh)
    neighbours = _Neighbours(mesh)
    faces = _faces(mesh, neighbours)
    pieces, face, tet = _split(mesh, faces)
    size = np.linalg.norm(pieces.area_vectors(), axis=1)
    is_real = size > SMALLEST_FACE**2 * neighbours.length[face] ** 2
    pieces, face, tet, size = pieces[is_real], face[is_real], tet[is_real], size[is_real]
    row = neighbours.edge_rows()
    areas = np.bincount(face, size, len(neighbours.pairs))
    areas[areas < SMALLEST_FACE * neighbours.length**2] = 0.0
    edge_areas = np.zeros(len(mesh.edges))
    edge_areas[row[row >= 0]] = areas[row >= 0]
    on_edge = (row[face] >= 0) & (areas[face] > 0)
    corners = _outlines(mesh, pieces[on_edge], row[face[on_edge]], tet[on_edge], edge_areas)
    cells = _cells(mesh, neighbours, face, tet, size)
    return VoronoiGraph(original, edge_areas, *corners, *cells)


class _Neighbours:
    """Pairs of vertices whose cells can touch, and the neighbours of each vertex."""

    def __init__(self, mesh: TetMesh) -> None:
        self.mesh = mesh
        found = scipy_spatial().Delaunay(mesh.vertices)
        if len(found.coplanar):
            raise MeshError(f"vertex {found.coplanar[0][0]} almost coincides with another: merge them")
        start, flat = found.vertex_neighbor_vertices
        count = np.diff(start)
        owner = np.repeat(np.arange(len(mesh.vertices)), count)
        width = int(count.max())
        self.of = np.full((len(mesh.vertices), width), -1)
        self.of[owner, np.arange(len(flat)) - start[owner]] = flat
        both = np.stack([owner, flat], axis=1).astype(np.int64)
        self.pairs = both[both[:, 0] < both[:, 1]]
        ends = mesh.vertices[self.pairs]
        self.length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        # Weights of a power diagram: cells still fill space, and faces stay perpendicular to their edges.
        scale = PERTURBATION * float(self.length.min()) ** 2
        self.weight = np.random.default_rng(0).uniform(-scale, scale, len(mesh.vertices))

        self._power = (mesh.vertices**2).sum(axis=1) - self.weight

    @property
    def distance(self) -> FloatArray:
        """Distance of each pair's face from the first vertex of the pair, (p,) [m]."""
        first, second = self.weight[self.pairs].T
        return np.asarray(0.5 * (self.length + (first - second) / self.length))

    def edge_rows(self) -> Ints:
        """Return the row of `mesh.edges` for each pair, (p,), or -1 if the pair is not an edge."""
        n = len(self.mesh.vertices)
        keys = self.mesh.edges[:, 0].astype(np.int64) * n + self.mesh.edges[:, 1]
        wanted = self.pairs[:, 0] * n + self.pairs[:, 1]
        index = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        return np.where(keys[index] == wanted, index, -1)

    def clip_to_cells(self, polygons: Polygons, vertex: Ints, other: Ints) -> None:
        """Clip each polygon to the Voronoi cell of a vertex.

        Args:
            polygons: N polygons, changed in place.
            vertex: vertex whose cell clips each polygon, (N,).
            other: neighbour of this vertex towards which the polygon is not clipped, (N,), or -1.
        """
        x = self.mesh.vertices
        for column in self.of.T:
            neighbour = column[vertex]
            rows = (neighbour >= 0) & (neighbour != other)
            normal = x[neighbour] - x[vertex]
            offset = 0.5 * (self._power[neighbour] - self._power[vertex])
            polygons.clip(normal, offset, neighbour, rows)


def _faces(mesh: TetMesh, neighbours: _Neighbours) -> Polygons:
    """Return the unclipped Voronoi face of each pair, right-handed about the direction of the pair.

    The label of a side is the vertex beyond this side.
    """
    ends = mesh.vertices[neighbours.pairs]
    axis = (ends[:, 1] - ends[:, 0]) / neighbours.length[:, None]
    helper = np.eye(3)[np.abs(axis).argmin(axis=1)]
    u = np.cross(axis, helper)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(axis, u)
    radius = 2.0 * np.linalg.norm(np.ptp(mesh.vertices, axis=0))
    center = ends[:, 0] + neighbours.distance[:, None] * axis
    square = np.stack(
        [center + radius * (a * u + b * v) for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))], axis=1
    )
    count = np.full(len(square), 4)
    faces = Polygons(square, np.full((len(square), 4), len(mesh.vertices)), count)
    neighbours.clip_to_cells(faces, neighbours.pairs[:, 0], neighbours.pairs[:, 1])
    return faces


def _split(mesh: TetMesh, faces: Polygons) -> tuple[Polygons, Ints, Ints]:
    """Split the Voronoi faces by the tetrahedra.

    Sides of pieces along the k-th face of a tetrahedron have the label -1 - k.
    Returns: the pieces, the Voronoi face of each piece, (q,), and the tetrahedron of each piece, (q,).
    """
    boxes = mesh.vertices[mesh.tets]
    low, high = boxes.min(axis=1), boxes.max(axis=1)
    is_corner = (np.arange(faces.corners.shape[1]) < faces.count[:, None])[..., None]
    face_low = np.where(is_corner, faces.corners, np.inf).min(axis=1)
    face_high = np.where(is_corner, faces.corners, -np.inf).max(axis=1)
    found = []
    for start in range(0, len(faces.count), 256):
        rows = slice(start, start + 256)
        meets = (face_low[rows, None] <= high).all(axis=2) & (face_high[rows, None] >= low).all(axis=2)
        face, tet = np.nonzero(meets)
        found.append(np.stack([face + start, tet]))
    face, tet = np.concatenate(found, axis=1)
    pieces = faces[face]
    all_rows = np.ones(len(face), dtype=bool)
    for k, corners in enumerate(LOCAL_FACES):
        a, b, c = (boxes[:, i] for i in corners)
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        pieces.clip(normal[tet], np.einsum("ma,ma->m", normal, a)[tet], -1 - k, all_rows)
    remaining = pieces.count > 0
    return pieces[remaining], face[remaining], tet[remaining]


def _outlines(
    mesh: TetMesh, pieces: Polygons, edge: Ints, tet: Ints, areas: FloatArray
) -> tuple[Ints, Ints, FloatArray]:
    """Join the pieces of each edge's face.

    Returns: `corner_edge`, `corner_tet` and `corner_weights` of the graph.
    """
    outer = _is_surface(mesh)
    order = np.argsort(edge, kind="stable")
    bounds = np.searchsorted(edge[order], np.arange(len(mesh.edges) + 1))
    following = np.take_along_axis(pieces.corners, pieces.next_corner()[..., None], axis=1)
    corner_edge, corner_tet, points = [], [], []
    for e in np.flatnonzero(areas > 0):
        sides: dict[tuple[int, int], list[tuple[FloatArray, FloatArray, int]]] = {}
        for row in order[bounds[e] : bounds[e + 1]]:
            t = int(tet[row])
            for i in range(pieces.count[row]):
                label = int(pieces.labels[row, i])
                if label < 0 and not outer[t, -1 - label]:
                    continue
                # A side of the unclipped face can cross several tetrahedra, a side on the surface only one.
                key = (label, -1) if label >= 0 else (label, t)
                sides.setdefault(key, []).append((pieces.corners[row, i], following[row, i], t))
        path = _closed_path(
            [part for parts in sides.values() for part in _joined(parts, mesh.edge_lengths[e])]
        )
        corner_edge += [e] * len(path)
        corner_tet += [t for _, t in path]
        points += [x for x, _ in path]
    tets = np.asarray(corner_tet, dtype=np.int64)
    corners = mesh.vertices[mesh.tets[tets]]
    return np.asarray(corner_edge, dtype=np.int64), tets, barycentric(np.asarray(points), corners)


Side = tuple[FloatArray, FloatArray, int, int]


def _joined(parts: list[tuple[FloatArray, FloatArray, int]], scale: float) -> list[Side]:
    """Join collinear segments that touch end to end.

    Returns: start, end, first tetrahedron and last tetrahedron of each joined segment.
    """
    direction = max((b - a for a, b, _ in parts), key=lambda d: float((d * d).sum()))
    parts = sorted(parts, key=lambda part: float((part[0] * direction).sum()))
    joined: list[Side] = []
    for a, b, t in parts:
        if joined and np.abs(joined[-1][1] - a).max() < 1e-6 * scale:
            joined[-1] = (joined[-1][0], b, joined[-1][2], t)
        else:
            joined.append((a, b, t, t))
    return joined


def _closed_path(sides: list[Side]) -> list[tuple[FloatArray, int]]:
    """Order sides into one closed path. Returns: corners of the path and their tetrahedra.

    If the sides form several loops, bridges connect the first corner of the path with the other loops. The
    path runs along each bridge in both directions, so that bridges enclose no area.
    """
    remaining = list(sides)
    path: list[tuple[FloatArray, int]] = []
    first_corner = (remaining[0][0], remaining[0][2])
    while remaining:
        a, b, t, _ = remaining.pop(0)
        loop_start = (a, t)
        path.append(loop_start)
        while remaining:
            gaps = [float(((side[0] - b) ** 2).sum()) for side in remaining]
            nearest = int(np.argmin(gaps))
            if gaps[nearest] > float(((loop_start[0] - b) ** 2).sum()):
                break
            a, b, t, _ = remaining.pop(nearest)
            path.append((a, t))
        path.append(loop_start)
        if loop_start[0] is not first_corner[0]:
            path.append(first_corner)
    return path


def _is_surface(mesh: TetMesh) -> NDArray[np.bool_]:
    """True for the faces of each tetrahedron that lie on the surface, (m, 4)."""
    n = len(mesh.vertices)

    def keys(triangles: NDArray[np.int32]) -> Ints:
        a, b, c = np.sort(triangles, axis=-1).astype(np.int64).T
        return np.asarray(((a * n + b) * n + c).T, dtype=np.int64)

    return np.isin(keys(mesh.tets[:, LOCAL_FACES]), keys(mesh.surface))


def _cells(
    mesh: TetMesh, neighbours: _Neighbours, face: Ints, tet: Ints, size: FloatArray
) -> tuple[Ints, Ints, FloatArray]:
    """Return `cell_tet`, `cell_vertex` and `cell_volume` of the graph.

    The boundary of a part consists of pieces of Voronoi faces and of the tetrahedron's faces. The volume of
    the part is the sum of the pyramids from the vertex to these pieces.
    """
    n = len(mesh.vertices)
    ends = neighbours.pairs[face]
    keys = np.unique(np.concatenate([tet * n + ends[:, i] for i in (0, 1)]))
    cell_tet, cell_vertex = np.divmod(keys, n)
    volume = np.zeros(len(keys))
    distance = neighbours.distance[face]
    for i, height in enumerate((distance, neighbours.length[face] - distance)):
        pyramid = size * height / 3.0
        volume += np.bincount(np.searchsorted(keys, tet * n + ends[:, i]), pyramid, len(keys))
    for corners in LOCAL_FACES:
        triangles = mesh.vertices[mesh.tets[cell_tet][:, corners]]
        parts = Polygons(triangles.copy(), np.zeros((len(keys), 3), np.int64), np.full(len(keys), 3))
        neighbours.clip_to_cells(parts, cell_vertex, np.full(len(keys), -1))
        offset = triangles[:, 0] - mesh.vertices[cell_vertex]
        volume += np.einsum("sa,sa->s", parts.area_vectors(), offset) / 3.0
    return cell_tet, cell_vertex, volume
