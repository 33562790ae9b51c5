"""Scene graph node that draws one soft body."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from panda3d import core

from engine_adapter.adapter import EngineAdapter
from engine_adapter.panda3d.looks import render_state, texture_places, vertex_colors
from taichi_soft import Body, OptionError, RenderMesh

_POSITIONS, _NORMALS, _LOOK = range(3)
"""Indices of the arrays in a vertex buffer: positions, normals, and texture coordinates or colours. A kernel
fills positions and normals in place."""


class SoftBodyNode(core.NodePath):  # type: ignore[misc]
    """A NodePath to a GeomNode that draws one body, in the coordinates of its parent node.

        node = SoftBodyNode(adapter, body)
        node.reparent_to(base.render)
        ...  # each frame after adapter.advance, or use a SoftBodyTask
        node.draw()

    If a body has skins, the node draws the artist's meshes, with textures and texture coordinates. Otherwise
    the node draws the body's surface. A kernel writes positions and normals directly into Panda3D's vertex
    buffers. The node makes new buffers after a cut, a tear, a restore, or a change of level of detail. A
    removed body is not drawn until `World.restore` restores it.

    Args:
        adapter: adapter that steps the body's world.
        body: body of that world.
        crease: angle above which an edge of a surface is sharp [degrees], see `Body.render_mesh`. Skins keep
            the artist's normals.
    Raises: OptionError for wrong types, and as `Body.render_mesh`.
    """

    def __init__(self, adapter: EngineAdapter, body: Body, *, crease: float | None = 60.0) -> None:
        if not isinstance(adapter, EngineAdapter):
            raise OptionError(f"adapter must be an EngineAdapter, got {type(adapter).__name__}")
        if not isinstance(body, Body):
            raise OptionError(f"body must be a taichi_soft.Body, got {type(body).__name__}")
        super().__init__(core.GeomNode(f"soft body {body.index}"))
        self._adapter, self._body, self._crease = adapter, body, crease
        self._meshes: tuple[RenderMesh, ...] = ()
        self._make()
        self.draw()

    @property
    def body(self) -> Body:
        """Body that the node draws."""
        return self._body

    @property
    def meshes(self) -> tuple[RenderMesh, ...]:
        """Current render meshes, in the order of the Geoms; empty after the body was removed."""
        return self._meshes

    def draw(self) -> None:
        """Fill the buffers with positions interpolated by `EngineAdapter.alpha`.

        Raises: as `EngineAdapter.render_mesh`.
        """
        if not self._body.is_alive:
            self._meshes = ()
            self.node().remove_all_geoms()
            return
        if not self._meshes or any(mesh.is_outdated for mesh in self._meshes):
            self._make()
        for number, mesh in enumerate(self._meshes):
            geom = self.node().modify_geom(number)  # `modify_geom` also updates the node's bounds
            data = geom.modify_vertex_data()
            positions = rows_in(data, _POSITIONS, 3)
            self._adapter.render_mesh(mesh, positions, rows_in(data, _NORMALS, 3))
            geom.set_bounds(_box_round(positions))

    def _make(self) -> None:
        """Make buffers for the current meshes of the body."""
        skins: tuple[RenderMesh, ...] = self._body.render_meshes
        self._meshes = skins or (self._body.render_mesh(crease=self._crease),)
        self.node().remove_all_geoms()
        for mesh in self._meshes:
            visual = getattr(mesh, "visual", None)
            places = texture_places(visual, mesh.vertex_count)
            colors = vertex_colors(visual, mesh.vertex_count)
            look = colors if places is None else places
            self.node().add_geom(_geom(mesh, look), render_state(visual, places is not None))


def rows_in(data: Any, array: int, width: int) -> NDArray[np.float32]:
    """Return a NumPy view of an array of a GeomVertexData, float32 (n, width). Do not keep the view, because
    Panda3D can move the array between frames."""
    view = memoryview(data.modify_array(array)).cast("B")
    return np.frombuffer(view, dtype=np.float32).reshape(-1, width)


def _box_round(positions: NDArray[np.float32]) -> Any:
    """Return a BoundingBox of points (n, 3) for culling. By default, Panda3D would compute a bounding sphere,
    which is much slower.
    """
    columns = positions.T.copy()
    corners = (
        core.LPoint3(*(float(end) for end in ends)) for ends in (columns.min(axis=1), columns.max(axis=1))
    )
    return core.BoundingBox(*corners)


def _geom(mesh: RenderMesh, look: NDArray[np.float32] | None) -> Any:
    """Make a Geom with buffers and triangles for a mesh. `look` contains the texture coordinates (k, 2) or
    the colours (k, 4) of the vertices, or is None.
    """
    width = 0 if look is None else look.shape[1]
    data = core.GeomVertexData("soft body", _vertex_format(width), core.Geom.UH_dynamic)
    data.set_num_rows(mesh.vertex_count)
    if look is not None:
        rows_in(data, _LOOK, width)[:] = look
    triangles = core.GeomTriangles(core.Geom.UH_static)
    triangles.set_index_type(core.Geom.NT_uint32)
    corners = triangles.modify_vertices()
    corners.unclean_set_num_rows(mesh.triangles.size)
    np.frombuffer(memoryview(corners).cast("B"), dtype=np.uint32)[:] = mesh.triangles.ravel()
    geom = core.Geom(data)
    geom.add_primitive(triangles)
    return geom


def _vertex_format(look: int) -> Any:
    """Return a vertex format with positions and normals. `look` = 2 adds texture coordinates, `look` = 4
    colours, and 0 nothing.
    """
    columns = [
        (core.InternalName.get_vertex(), 3, core.Geom.C_point),
        (core.InternalName.get_normal(), 3, core.Geom.C_normal),
    ]
    if look == 2:
        columns.append((core.InternalName.get_texcoord(), 2, core.Geom.C_texcoord))
    elif look == 4:
        columns.append((core.InternalName.get_color(), 4, core.Geom.C_color))
    form = core.GeomVertexFormat()
    for name, width, contents in columns:
        form.add_array(core.GeomVertexArrayFormat(name, width, core.Geom.NT_float32, contents))
    return core.GeomVertexFormat.register_format(form)
