"""Render mesh of a body: triangles, and the vertices and normals of each frame."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.bodies.kernels.render_mesh import RING, SMALL_RING, write_render_mesh
from taichi_soft.bodies.soft_body import SoftBody, require_alive
from taichi_soft.core.checks import as_number
from taichi_soft.core.constants import LANES
from taichi_soft.core.errors import MeshError, StateError
from taichi_soft.meshing.arrays import read_only
from taichi_soft.meshing.creases import split_at_creases

Floats32 = NDArray[np.float32]
Ints32 = NDArray[np.int32]

MIN_PARALLEL_VERTICES = 4000
"""Smallest number of render vertices for which several threads are used. Waking the threads takes as long as
computing a few thousand vertices."""


class RenderMesh:
    """The surface of one body for a renderer, read-only. Created by `Body.render_mesh`.

    The mesh contains only vertices on the surface, with one copy for each side of a sharp edge. It never
    changes. A cut changes the vertices of the body, so the mesh is then outdated and you must make a new one.
    Example:
        skin = body.render_mesh(crease=40)  # skin.triangles is the index buffer
        vertices = np.empty((skin.vertex_count, 3), np.float32)
        normals = np.empty_like(vertices)
        game.advance(1 / 60)
        game.render_mesh(skin, vertices, normals)
    """

    def __init__(self, body: SoftBody, vertices: NDArray[np.int64], triangles: Ints32) -> None:
        """Use `Body.render_mesh` instead.

        Args:
            body: body to draw.
            vertices: vertex of the body that each render vertex copies, (k,).
            triangles: render vertices of each triangle, (m, 3).
        """
        self._describe(body, vertices, triangles)
        self._table = render_table(vertices, triangles)

    def _describe(self, body: SoftBody, vertices: NDArray[np.int64], triangles: Ints32) -> None:
        self._body = body
        self._body_vertices: Ints32 = read_only(vertices.astype(np.int32))
        self._triangles: Ints32 = read_only(triangles)
        self._topology_version = body.topology_version

    @property
    def _suggested_fix(self) -> str:
        return "make a new one by body.render_mesh(), and buffers for its vertex_count"

    def _write(self, state: Any, alpha: float, positions: Floats32, normals: Floats32) -> None:
        """Write positions and normals, (k, 3) each, from the fields of a world."""
        is_serial = self.vertex_count < MIN_PARALLEL_VERTICES
        _write(state, is_serial, self._body.index, alpha, self._table, positions, normals)

    def __repr__(self) -> str:
        state = ", outdated" if self.is_outdated else ""
        return f"RenderMesh({self.vertex_count} vertices, {len(self._triangles)} triangles{state})"

    @property
    def body(self) -> SoftBody:
        """Body that the mesh draws."""
        return self._body

    @property
    def vertex_count(self) -> int:
        """Number of render vertices, k."""
        return len(self._body_vertices)

    @property
    def triangles(self) -> Ints32:
        """Index buffer: render vertices of each triangle, int32 (m, 3), counterclockwise from outside."""
        return self._triangles

    @property
    def body_vertices(self) -> Ints32:
        """Vertex of the body that each render vertex copies, int32 (k,).

        Use this array to convert values per body vertex to values per render vertex:
        `body.vertex_stress()[mesh.body_vertices]`.
        """
        return self._body_vertices

    @property
    def topology_version(self) -> int:
        """Topology version of the body when this mesh was made."""
        return self._topology_version

    @property
    def is_outdated(self) -> bool:
        """True after a cut, a tear, a restore or a change of level of the body. Then make a new mesh."""
        return self._topology_version != self._body.topology_version


def surface_render_mesh(body: SoftBody, crease: float | None) -> RenderMesh:
    """See `Body.render_mesh`."""
    require_alive(body)
    if crease is not None:
        crease = as_number(crease, "crease", 0.0, 180.0, "an angle from 0 to 180 degrees, or None")
    if body.asset.description.is_rigid:
        raise MeshError(f"{body!r} has skins to draw instead: see Body.render_meshes")
    if len(body.surface) == 0:
        raise MeshError(f"{body!r} has no triangles to draw: pass surface= to its ParticleMesh")
    return RenderMesh(body, *split_at_creases(body.mesh.vertices, body.surface, crease))


def require_current(mesh: RenderMesh) -> None:
    """Check that a mesh is not outdated. Raises: StateError if it is, or if its body was removed."""
    body = mesh.body
    require_alive(body)
    if mesh.is_outdated:
        raise StateError(
            f"body {body.index} was cut, torn, given another level or restored since this render mesh was "
            "made (topology_version "
            f"{mesh.topology_version}, now {body.topology_version}): {mesh._suggested_fix}"
        )


def read_render_mesh(
    state: Any, mesh: RenderMesh, alpha: float, positions: Floats32, normals: Floats32
) -> None:
    """Write positions and normals, (k, 3) each, from the fields of a world. See `World.read_render_mesh`."""
    mesh._write(state, alpha, positions, normals)


def warm_up(state: Any, assets: Iterable[SoftBodyAsset]) -> None:
    """Compile the serial kernel of `read_render_mesh`, and the parallel kernel if an asset can need it."""
    # One triangle, whose three corners are the first vertex of the first body.
    table = render_table(np.zeros(3, dtype=np.int64), np.arange(3).reshape(1, 3))
    positions, normals = np.empty((2, 3, 3), dtype=np.float32)
    _write(state, True, 0, 1.0, table, positions, normals)
    if any(asset.spare_vertices or 3 * len(asset.mesh.surface) >= MIN_PARALLEL_VERTICES for asset in assets):
        _write(state, False, 0, 1.0, table, positions, normals)


def _write(
    state: Any,
    is_serial: bool,
    body: int,
    alpha: float,
    table: Ints32,
    positions: Floats32,
    normals: Floats32,
) -> None:
    write_render_mesh(state, is_serial, body, alpha, table, positions.reshape(-1), normals.reshape(-1))


def render_table(vertices: NDArray[np.int64], triangles: NDArray[Any]) -> Ints32:
    """Return the table for `write_render_mesh`.

    The table is one array, because each argument of a kernel takes as long as 100 vertices. It contains:
    1. the blocks;
    2. the vertex of the body that each render vertex copies;
    3. for each block, the index in the table of its first further triangle, and the end of the table;
    4. the number of blocks that have only small rings;
    5. the further triangles.

    A block has `LANES` render vertices, followed by `RING` rows with the rings around these vertices.
    Triangles (v, a, b) and (v, b, c) form the ring a, b, c, which is padded with v. A further triangle does
    not fit into the ring of its first vertex. It is stored as the lane of this vertex and the two other
    vertices. The last block is padded with copies of the last vertex, its ring and its further triangles.
    """
    count = len(vertices)
    rings, further = _rings(count, triangles)
    is_small = (rings[:, SMALL_RING:] == np.arange(count)[:, None]).all(axis=1)
    order = np.argsort(~is_small, kind="stable")
    lanes = order[np.minimum(np.arange(-(-count // LANES) * LANES), count - 1)]
    blocks = np.concatenate([lanes[:, None], rings[lanes]], axis=1).reshape(-1, LANES, 1 + RING)
    further[:, 0] = np.argsort(order)[further[:, 0]]
    further = further[np.argsort(further[:, 0], kind="stable")]
    last = further[further[:, 0] == count - 1]
    padding = np.arange(count, len(lanes))
    repeated = np.tile(last, (len(padding), 1))
    repeated[:, 0] = np.repeat(padding, len(last))
    further = np.concatenate([further, repeated])
    begins = 3 * np.r_[0, np.cumsum(np.bincount(further[:, 0] // LANES, minlength=len(blocks)))]
    further[:, 0] %= LANES
    begins += blocks.size + count + len(begins) + 1
    small = np.array([is_small[lanes].reshape(-1, LANES).all(axis=1).sum()])
    parts = (blocks.swapaxes(1, 2).ravel(), vertices, begins, small, further.ravel())
    return np.concatenate(parts).astype(np.int32)


def _rings(count: int, triangles: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Find the ring around each render vertex, (k, RING), and the triangles that do not fit, (f, 3).

    A triangle that does not fit into the ring of one of its vertices begins with this vertex. These triangles
    are sorted by first vertex. If a vertex lies on a border of the surface, its ring begins at the border. A
    ring ends when it is full or no triangle continues it.
    """
    rotations = triangles[:, [[0, 1, 2], [1, 2, 0], [2, 0, 1]]].reshape(-1, 3).astype(np.int64)
    own, one, other = rotations[np.argsort(triangles.ravel(), kind="stable")].T
    key = own * count + one
    order = np.argsort(key, kind="stable")
    row = np.minimum(np.searchsorted(key[order], own * count + other), len(key) - 1)
    next_row = np.where(key[order][row] == own * count + other, order[row], -1)
    is_inner = np.zeros(len(key), dtype=np.bool_)
    is_inner[next_row[next_row >= 0]] = True
    by_vertex = np.lexsort((is_inner, own))
    current = by_vertex[np.searchsorted(own, np.arange(count))]
    rings = np.tile(np.arange(count)[:, None], (1, RING))
    rings[:, 0] = one[current]
    is_unused, continues = np.ones(len(key), dtype=np.bool_), np.ones(count, dtype=np.bool_)
    for slot in range(1, RING):
        rings[continues, slot] = other[current[continues]]
        is_unused[current[continues]] = False
        current = np.where(continues, next_row[current], -1)
        continues = (current >= 0) & is_unused[current]
    return rings, np.stack([own, one, other], axis=1)[is_unused]
