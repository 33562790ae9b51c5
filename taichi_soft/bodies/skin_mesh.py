"""Render mesh of a skin: the vertices and normals of an artist's mesh in each frame."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.kernels.skin import FRAME, LANES, ROW, write_skin
from taichi_soft.bodies.render_mesh import RenderMesh
from taichi_soft.bodies.skin import Skin
from taichi_soft.bodies.soft_body import SoftBody, present_asset, record_of, require_alive
from taichi_soft.core.errors import OptionError
from taichi_soft.meshing import TetMesh

Floats32 = NDArray[np.float32]

MIN_PARALLEL_VERTICES = 2000
"""Smallest number of vertices for which several threads are used. Waking the threads takes as long as
computing a few thousand vertices."""


class SkinMesh(RenderMesh):
    """The skin of one body, in the order of the artist's mesh, read-only. Created by `Body.render_meshes`.

    `body_vertices` are the nearest vertices of the body. A skin cannot follow a cut, so after a cut or a tear
    the skin mesh remains outdated.
    """

    def __init__(self, body: SoftBody, number: int) -> None:
        """Use `Body.render_meshes` instead. `number` is the index of a surface in the asset's skin."""
        self._body, self._number = body, number
        self._bind()

    def _bind(self) -> None:
        """Bind to the tetrahedra of the body's current level of detail."""
        body = self._body
        asset, self._level = present_asset(body), record_of(body).level
        self._skin: Skin = asset.skins[self._number]
        assert isinstance(asset.mesh, TetMesh)
        corners = asset.mesh.tets[self._skin.tets]
        nearest = corners[np.arange(len(corners)), self._skin.weights.argmax(axis=1)]
        self._describe(body, nearest.astype(np.int64), self._skin.surface.triangles)
        self._frames = np.empty(FRAME * len(asset.mesh.vertices), dtype=np.float32)

    @property
    def _present_skin(self) -> Skin:
        if self._level != record_of(self._body).level:
            self._bind()
        return self._skin

    @property
    def body_vertices(self) -> NDArray[np.int32]:
        """For each render vertex, the vertex of the body with the largest weight, int32 (k,)."""
        _ = self._present_skin
        return super().body_vertices

    def __repr__(self) -> str:
        state = ", outdated" if self.is_outdated else ""
        name = f"{self.name!r}, " if self.name else ""
        return f"SkinMesh({name}{self.vertex_count} vertices, {len(self.triangles)} triangles{state})"

    @property
    def name(self) -> str:
        """Name of the mesh in its file."""
        return self._skin.surface.name

    @property
    def visual(self) -> Any:
        """Visual of trimesh: texture coordinates, material and colours. None if the mesh has no visual."""
        return self._skin.surface.visual

    @property
    def is_outdated(self) -> bool:
        """True if the body was cut or torn, because a skin cannot follow a cut."""
        return self._body.is_cut

    @property
    def _suggested_fix(self) -> str:
        return "a skin cannot follow a cut: draw body.render_mesh() instead"

    def _write(self, state: Any, alpha: float, positions: Floats32, normals: Floats32) -> None:
        skin, n = self._present_skin, self._body.vertex_count
        rows = positions.reshape(-1), normals.reshape(-1)
        is_serial = n + skin.vertex_count < MIN_PARALLEL_VERTICES
        write_skin(state, is_serial, self._body.index, n, alpha, skin.ints, skin.floats, self._frames, *rows)


def skin_meshes(body: SoftBody) -> tuple[SkinMesh, ...]:
    """Return the skin meshes of a body. The tuple is empty if the body has no skin, or was cut or torn."""
    if body.is_cut:
        return ()
    record = record_of(body)
    if record.skin_meshes is None:
        record.skin_meshes = tuple(SkinMesh(body, i) for i in range(len(body.asset.skin)))
    return record.skin_meshes


def first_skin_mesh(body: SoftBody) -> SkinMesh:
    """Return the first skin mesh of a body.

    Raises: OptionError if the body has no skin or was cut; StateError if it was removed.
    """
    require_alive(body)
    meshes = skin_meshes(body)
    if not meshes:
        raise OptionError(
            f"mesh must be a RenderMesh, and {body!r} has no skin to use instead: draw body.render_mesh()"
        )
    return meshes[0]


def warm_up(state: Any) -> None:
    """Compile the serial and the parallel kernel of skins, by calling both for a single vertex."""
    ints, floats = np.zeros(2 + 4 * LANES, np.int32), np.zeros(3 + ROW * LANES, np.float32)
    frames, positions, normals = np.empty(FRAME, dtype=np.float32), *np.empty((2, 3), dtype=np.float32)
    for is_serial in (True, False):
        write_skin(state, is_serial, 0, 1, 1.0, ints, floats, frames, positions, normals)
