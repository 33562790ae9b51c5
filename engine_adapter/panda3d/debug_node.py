"""Draw cages, colliders and grabs as lines, for debugging."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from panda3d import core

from engine_adapter.adapter import EngineAdapter
from engine_adapter.panda3d.soft_body_node import rows_in
from taichi_soft import Body, Collider, OptionError, Shape

Floats = NDArray[np.float64]

_AWAKE, _ASLEEP, _FROZEN = (1.0, 1.0, 1.0, 1.0), (0.3, 0.5, 1.0, 1.0), (1.0, 0.1, 0.1, 1.0)
_COLLIDER, _GRAB = (0.1, 0.9, 0.2, 1.0), (1.0, 0.9, 0.0, 1.0)
_CROSS = 0.05
"""Half the size of the cross at the target of a grab [m]."""


class DebugNode(core.NodePath):  # type: ignore[misc]
    """A NodePath that shows the edges of all bodies and colliders, and the targets of grabs, as lines.

    Moving bodies are white, sleeping bodies blue, and frozen bodies red. Colliders are green, and grabs are
    yellow crosses. Bodies are drawn at interpolated positions, as in `SoftBodyNode`. Colliders are drawn at
    their positions after the last step. A hidden node computes nothing.

    Args:
        adapter: adapter that steps the world.
    Raises: OptionError if `adapter` is not an EngineAdapter.
    """

    def __init__(self, adapter: EngineAdapter) -> None:
        if not isinstance(adapter, EngineAdapter):
            raise OptionError(f"adapter must be an EngineAdapter, got {type(adapter).__name__}")
        super().__init__(core.GeomNode("soft body debug"))
        self._adapter = adapter
        self._body_edges: dict[Body, tuple[int, NDArray[np.int32]]] = {}  # topology version, edges
        self._shape_edges: dict[Shape, Floats] = {}
        self.set_light_off(1)
        self.set_texture_off(1)
        self.set_depth_offset(1)  # draw in front of the surface that contains the lines

    def draw(self) -> None:
        """Update the lines, unless the node is hidden."""
        self.node().remove_all_geoms()
        if self.is_hidden():
            return
        world = self._adapter.world
        parts = [(self._of_body(body), _body_color(body)) for body in world.bodies]
        parts += [(self._of_collider(each), _COLLIDER) for each in world.colliders if each.is_alive]
        parts += [(_of_grab(grab.point), _GRAB) for grab in world.grabs]
        parts = [(ends, color) for ends, color in parts if len(ends)]
        if parts:
            self.node().add_geom(_lines(parts))

    def _of_body(self, body: Body) -> NDArray[Any]:
        """Return the endpoints of all edges of a body, (2 k, 3) [m]. Ropes and cloths have no tetrahedra."""
        version, edges = self._body_edges.get(body, (-1, np.zeros((0, 2), dtype=np.int32)))
        if version != body.topology_version:
            edges = _edges_of(body.tets) if len(body.tets) else body.mesh.edges
            self._body_edges[body] = body.topology_version, edges
        return self._adapter.positions(body)[edges.reshape(-1)]

    def _of_collider(self, collider: Collider) -> Floats:
        """Return the endpoints of the edges of a collider's shape at its pose, (2 k, 3) [m]."""
        shape = collider.shape
        if shape not in self._shape_edges:
            vertices, triangles = shape.surface()
            self._shape_edges[shape] = vertices[_edges_of(triangles).reshape(-1)]
        placed: Floats = self._shape_edges[shape] @ collider.rotation.T + collider.position
        return placed


def _edges_of(simplices: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the unique edges of triangles (m, 3) or tetrahedra (m, 4), (k, 2)."""
    corners = simplices.shape[1]
    pairs = [simplices[:, [i, j]] for i in range(corners) for j in range(i)]
    edges: NDArray[np.int32] = np.unique(np.sort(np.concatenate(pairs), axis=1), axis=0)
    return edges


def _body_color(body: Body) -> tuple[float, ...]:
    if body.is_frozen:
        return _FROZEN
    return _ASLEEP if body.is_asleep else _AWAKE


def _of_grab(point: Floats) -> Floats:
    arms = _CROSS * np.eye(3)
    return np.concatenate([[point - arm, point + arm] for arm in arms])


def _lines(parts: list[tuple[NDArray[Any], tuple[float, ...]]]) -> Any:
    """Make a Geom with the lines of each part, from its endpoints (2 k, 3) and its colour."""
    ends = np.concatenate([each for each, _ in parts]).astype(np.float32)
    colors = np.concatenate(
        [np.tile(np.array(color, dtype=np.float32), (len(each), 1)) for each, color in parts]
    )
    form = core.GeomVertexFormat()
    columns = (
        (core.InternalName.get_vertex(), 3, core.Geom.C_point),
        (core.InternalName.get_color(), 4, core.Geom.C_color),
    )
    for name, width, contents in columns:
        form.add_array(core.GeomVertexArrayFormat(name, width, core.Geom.NT_float32, contents))
    data = core.GeomVertexData("lines", core.GeomVertexFormat.register_format(form), core.Geom.UH_dynamic)
    data.set_num_rows(len(ends))
    rows_in(data, 0, 3)[:] = ends
    rows_in(data, 1, 4)[:] = colors
    lines = core.GeomLines(core.Geom.UH_dynamic)
    lines.add_next_vertices(len(ends))
    geom = core.Geom(data)
    geom.add_primitive(lines)
    return geom
