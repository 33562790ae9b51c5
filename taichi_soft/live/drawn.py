"""Render meshes of a world's bodies and colliders, and their positions in each frame."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft import Body, RenderMesh
from taichi_soft.bodies.skin_mesh import SkinMesh
from taichi_soft.live.frame_file import Frame
from taichi_soft.live.scene import Scene
from taichi_soft.render.props import SLATE, drawn_surface, is_drawn
from taichi_soft.render.skin_looks import texture_picture, vertex_colors

CREASE = 65.0
"""Largest angle between adjacent triangles that are shaded smooth [degrees]. It is larger than the
angles of an icosahedron (42) and of a ring with six sides (60), and smaller than the angle of a box (90)."""


class Drawn:
    """Meshes of all bodies and colliders, valid until a body is added, removed or cut."""

    def __init__(self, scene: Scene, version: int) -> None:
        self.scene, self.version = scene, version
        self.bodies: list[Body] = list(scene.world.bodies)
        self._topology = [body.topology_version for body in self.bodies]
        self.meshes: list[tuple[Body, RenderMesh]] = [
            (body, mesh) for body in self.bodies if len(body.surface) for mesh in _meshes_of(body)
        ]
        self.starts = np.cumsum([0, *(mesh.vertex_count for _, mesh in self.meshes)])
        self.colliders = [each for each in scene.world.colliders if is_drawn(each)]

    @property
    def is_outdated(self) -> bool:
        """True if bodies have been added, removed or cut since the meshes were made."""
        bodies = self.scene.world.bodies
        same = len(bodies) == len(self.bodies) and all(
            a is b for a, b in zip(bodies, self.bodies, strict=True)
        )
        return not same or [body.topology_version for body in bodies] != self._topology

    @property
    def vertex_count(self) -> int:
        """Number of vertices of all bodies."""
        return int(self.starts[-1])

    def described(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Describe the meshes for a page. Returns: a header, and arrays of triangles and colours by name."""
        triangles, counts = [], []
        colors = np.empty((self.vertex_count, 3), np.uint8)
        for (body, mesh), start in zip(self.meshes, self.starts[:-1], strict=True):
            triangles.append(mesh.triangles + np.uint32(start))
            counts.append(len(mesh.triangles))
            colors[start : start + mesh.vertex_count] = np.rint(255.0 * self._colors(body, mesh))
        solids = [drawn_surface(each.shape) for each in self.colliders]
        camera, floor = self.scene.camera, self.scene.world.settings.floor
        header = {
            "version": self.version,
            "title": self.scene.title,
            "vertices": self.vertex_count,
            "bodies": [
                {"slot": body.index, "first": int(start), "count": mesh.vertex_count, "triangles": count}
                for (body, mesh), start, count in zip(self.meshes, self.starts[:-1], counts, strict=True)
            ],
            "colliders": [{"vertices": len(v), "triangles": len(t)} for v, t in solids],
            "collider_color": list(SLATE),
            "floor": floor,
            "camera": {"eye": camera.eye, "target": camera.target, "fov": camera.fov_degrees},
        }
        arrays = {
            "triangles": np.concatenate([np.zeros((0, 3), np.uint32), *triangles]).astype("<u4"),
            "colors": colors,
            "collider_vertices": np.concatenate([np.zeros((0, 3)), *(v for v, _ in solids)]).astype("<f4"),
            "collider_triangles": np.concatenate([np.zeros((0, 3)), *(t for _, t in solids)]).astype("<u4"),
        }
        return header, arrays

    def _colors(self, body: Body, mesh: RenderMesh) -> NDArray[np.float32]:
        """Return vertex colours, (n, 3), sRGB from 0 to 1. A texture is sampled at the vertices."""
        plain = self.scene.color(body.index)
        if not isinstance(mesh, SkinMesh):
            return np.broadcast_to(np.asarray(plain, np.float32), (mesh.vertex_count, 3))
        colors = vertex_colors(mesh.visual, mesh.vertex_count, plain)
        picture = texture_picture(mesh.visual, mesh.vertex_count)
        if picture is None:
            return colors
        texels = np.asarray(picture.convert("RGB"), np.float32) / 255.0
        u, v = (mesh.visual.uv % 1.0).T
        height, width = texels.shape[:2]
        rows = ((1.0 - v) * (height - 1) + 0.5).astype(int).clip(0, height - 1)
        columns = (u * (width - 1) + 0.5).astype(int).clip(0, width - 1)
        return np.asarray(colors * texels[rows, columns], dtype=np.float32)

    def fill(self, frame: Frame, alpha: float, tints: NDArray[np.uint8] | None) -> None:
        """Write all positions into a frame, interpolated to the fraction `alpha` of the last step.

        Args:
            tints: indices into the colour scale for all particles, body by body, or None.
        """
        world, at, firsts = self.scene.world, 0, {}
        for body in self.bodies:
            firsts[body.index] = at
            at += body.vertex_count
        for (body, mesh), start in zip(self.meshes, self.starts[:-1], strict=True):
            rows = slice(start, start + mesh.vertex_count)
            world.read_render_mesh(mesh, alpha, frame.positions[rows], frame.normals[rows])
            if tints is not None:
                frame.tints[rows] = tints[firsts[body.index] :][mesh.body_vertices]
        for row, collider in zip(frame.poses, self.colliders, strict=True):
            row[:9] = np.asarray(collider.rotation, np.float32).reshape(9)
            row[9:] = collider.position


def _meshes_of(body: Body) -> tuple[RenderMesh, ...]:
    return body.render_meshes or (body.render_mesh(crease=CREASE),)
