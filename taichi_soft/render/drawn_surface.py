"""A surface to draw: triangles with moving vertices and colours."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.core.checks import as_array, to_array
from taichi_soft.core.errors import MeshError, OptionError
from taichi_soft.meshing import BodyMesh
from taichi_soft.meshing.creases import DEFAULT_CREASE, split_at_creases
from taichi_soft.render.colors import PALETTE, to_linear
from taichi_soft.render.look import CLOTH, CLOTH_BACK, CODES, Look, LookName
from taichi_soft.render.texture import Texture

# Largest absolute value of a coordinate [m]. Larger values occur only after an explosion. Products of such
# values would overflow in float32.
FARTHEST = 1e7


class Surface:
    """Surface to draw: triangles over the vertices of a body.

    Before each frame, set `positions`, and also `color` if it changes.

    Args:
        positions: positions of all vertices of the body, including inner vertices, (n, 3) [m]. An edge
            stays sharp if its triangles meet at more than 60 degrees in these positions. Other edges are
            shaded smooth.
        triangles: vertex indices, (m, 3), counterclockwise seen from outside. Only a cloth is drawn from both
            sides. Shadows assume a closed surface.
        color: sRGB from 0 to 1, either (3,) for the whole body or (n, 3), one per vertex.
        normals: unit normals for shading, (n, 3); None computes normals from the triangles. If you pass
            normals, set them with the positions before each frame.
        texture: texture, multiplied by `color`; use white to leave it unchanged.
        uv: (n, 2), texture coordinates of the vertices: (0, 0) at the lower left, (1, 1) at the upper right;
            the texture repeats.
        look: "matte", "jelly" or "cloth". If a cloth has each triangle twice, once per side, the first of the
            two is the front.
    Raises: OptionError for wrong shapes, an unknown look, a texture without `uv` or the reverse, positions
        that are not finite (as after an explosion) or colours out of range; MeshError for indices out of
        range.
    """

    def __init__(
        self,
        positions: ArrayLike,
        triangles: ArrayLike,
        *,
        color: ArrayLike = PALETTE[0],
        normals: ArrayLike | None = None,
        texture: Texture | None = None,
        uv: ArrayLike | None = None,
        look: Look | LookName = Look.MATTE,
    ) -> None:
        own = as_array(positions, "positions", (None, 3))
        self.vertex_count, first = len(own), self.spread(own).astype(np.float64)
        corners = to_array(triangles, "triangles").copy()
        if corners.ndim != 2 or corners.shape[1] != 3 or corners.dtype.kind not in "iu" or len(corners) == 0:
            raise MeshError(f"triangles must be whole numbers of shape (m, 3), got shape {corners.shape}")
        if corners.min() < 0 or corners.max() >= len(first):
            raise MeshError(
                f"triangles name vertices {corners.min()} to {corners.max()}, there are {len(first)}"
            )
        self.look = Look.parse(look)
        codes = np.full(len(corners), CODES[self.look], dtype=np.int32)
        if self.look is Look.CLOTH:
            corners, codes = _both_sides(corners)
        self.looks = codes
        # Only vertices on the surface are projected and lit. A vertex on a sharp edge is stored once per
        # side.
        if normals is None:
            self._used, self.triangles = split_at_creases(first, corners, DEFAULT_CREASE)
        else:
            self._used, self.triangles = np.arange(self.vertex_count), corners.astype(np.int32)
            if self.look is Look.CLOTH:  # the back has separate vertices with opposite normals
                self._used = np.tile(self._used, 2)
                self.triangles[codes == CLOTH_BACK] += self.vertex_count
        self.positions = own
        self.color = color
        self._normals: NDArray[np.float32] | None = None
        if normals is not None:
            self.normals = normals
        if not (texture is None or isinstance(texture, Texture)):
            raise OptionError(f"texture must be a Texture, got {type(texture).__name__}")
        if (texture is None) != (uv is None):
            raise OptionError("texture and uv go together: give both or neither")
        self.texture = texture
        self.uv: NDArray[np.float32] | None = None
        if uv is not None:
            self.uv = as_array(uv, "uv", (self.vertex_count, 2))[self._used].astype(np.float32)

    @classmethod
    def of(
        cls, mesh: BodyMesh, *, color: ArrayLike = PALETTE[0], look: Look | LookName = Look.MATTE
    ) -> Surface:
        """Make the surface of a mesh. The surface has its rest shape until you set `positions`.

        Args:
            mesh: a `TetMesh`, a `ShellMesh`, or a `ParticleMesh` with triangles.
            color: sRGB from 0 to 1, (3,) or one per vertex (n, 3).
            look: "matte", "jelly" or "cloth".
        Raises: MeshError for a `ParticleMesh` without triangles, such as a rope.
        """
        if not isinstance(mesh, BodyMesh):
            raise MeshError(
                f"a surface is made of a TetMesh, a ParticleMesh or a ShellMesh, got {type(mesh).__name__}"
            )
        if len(mesh.surface) == 0:
            raise MeshError(f"{mesh!r} has no triangles to draw: give it some with surface=")
        return cls(mesh.vertices, mesh.surface, color=color, look=look)

    @property
    def positions(self) -> NDArray[np.float32]:
        """Positions of the vertices on the surface, float32 (k, 3) [m].

        A vertex on a sharp edge occurs once per side. Assign the positions of all n vertices of the body,
        (n, 3).
        """
        return self._positions

    @positions.setter
    def positions(self, values: ArrayLike) -> None:
        rows = to_array(values, "positions")
        if rows.shape != (self.vertex_count, 3) or rows.dtype.kind not in "fiu":
            raise OptionError(f"positions must have shape ({self.vertex_count}, 3), got {rows.shape}")
        outer = self.spread(rows)[self._used].astype(np.float32)
        if not np.abs(outer).max() < FARTHEST:  # also rejects NaN
            bad = int(np.argmin((np.abs(outer) < FARTHEST).all(axis=1)))
            raise OptionError(
                f"vertex {self._used[bad]} is at {outer[bad].tolist()}: positions must be finite and below "
                f"{FARTHEST:g} m (has the simulation exploded?)"
            )
        self._positions: NDArray[np.float32] = outer

    def spread(self, rows: NDArray[np.floating]) -> NDArray[np.floating]:
        """Return the positions of the vertices of triangles [m]: here, the assigned ones.

        Args:
            rows: assigned `positions`, (n, 3) [m].
        """
        return rows

    def spread_colors(self, rows: NDArray[np.floating]) -> NDArray[np.floating]:
        """Return the colours of the vertices of triangles, sRGB: here, the assigned ones.

        Args:
            rows: assigned colours, (n, 3).
        """
        return rows

    @property
    def normals(self) -> NDArray[np.float32] | None:
        """Shading normals at `positions`, float32 (k, 3), or None. Assign normals of all vertices, (n, 3)."""
        return self._normals

    @normals.setter
    def normals(self, values: ArrayLike) -> None:
        rows = as_array(values, "normals", (self.vertex_count, 3)).astype(np.float32)[self._used]
        rows[self.vertex_count :] *= -1.0
        self._normals = rows

    @property
    def color(self) -> NDArray[np.float32]:
        """Colours at `positions` in linear light, float32 (k, 3). Assign sRGB colours, (3,) or (n, 3)."""
        return self._color

    @color.setter
    def color(self, values: ArrayLike) -> None:
        rows = to_array(values, "color")
        if rows.shape == (3,):
            rows = np.broadcast_to(rows, (self.vertex_count, 3))
        if rows.shape != (self.vertex_count, 3) or rows.dtype.kind not in "fiu":
            raise OptionError(f"color must have shape (3,) or ({self.vertex_count}, 3), got {rows.shape}")
        outer = self.spread_colors(rows)[self._used].astype(np.float32)
        if not (outer.min() >= 0.0 and outer.max() <= 1.0):
            raise OptionError(f"color must be sRGB from 0 to 1, got {outer.min():g} to {outer.max():g}")
        self._color = to_linear(outer)


def _both_sides(triangles: NDArray[np.integer]) -> tuple[NDArray[np.integer], NDArray[np.int32]]:
    """Return the front and then the back triangles of a sheet, and their look codes.

    If the sheet contains a triangle twice, once per side, only the first copy is used.
    """
    _, first = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)
    front = triangles[np.sort(first)]
    codes = np.repeat(np.array([CLOTH, CLOTH_BACK], dtype=np.int32), len(front))
    return np.concatenate([front, front[:, ::-1]]), codes
