"""Render meshes of an asset: its skins, or its surface if it has no skin."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.bodies.kernels.render_mesh import write_render_mesh
from taichi_soft.bodies.kernels.skin import write_skin
from taichi_soft.bodies.render_mesh import MIN_PARALLEL_VERTICES as FEWEST_OF_SURFACE
from taichi_soft.bodies.render_mesh import render_table
from taichi_soft.bodies.skin_mesh import MIN_PARALLEL_VERTICES as FEWEST_OF_SKIN
from taichi_soft.meshing.creases import split_at_creases

CREASE = 40.0
"""Smallest angle between two adjacent triangles at which the edge between them is sharp [degrees]."""


@dataclass(frozen=True, eq=False)
class Table:
    """Array arguments of the kernel that writes a render mesh."""

    is_skin: bool
    is_serial: bool
    ints: NDArray[np.int32]
    floats: NDArray[np.float32]  # unused unless the mesh is a skin

    @property
    def kernel(self) -> tuple[str, Any]:
        """Name of the kernel in the world file, and the kernel."""
        name, kernel = (
            ("write_skin", write_skin) if self.is_skin else ("write_render_mesh", write_render_mesh)
        )
        return (name if self.is_serial else f"{name}_shared"), kernel


@dataclass(frozen=True, eq=False)
class ExportedMesh:
    """A render mesh of an asset."""

    name: str
    asset: int
    level: int  # level of detail at which the mesh is drawn; -1 for all levels
    vertex_count: int
    triangles: NDArray[np.int32]  # (m, 3)
    tables: list[Table]  # one for a surface, one per level for a skin
    uv: NDArray[np.float32]  # texture coordinates, (k, 2), or empty

    @property
    def is_skin(self) -> bool:
        """True for a skin. Skins are drawn at every level of detail."""
        return self.tables[0].is_skin


def meshes_of(number: int, asset: SoftBodyAsset, name: str) -> list[ExportedMesh]:
    """Return the render meshes of an asset: its skins, or the surfaces of its levels if it has no skin."""
    found = []
    for i, skin in enumerate(asset.skins):
        surface = skin.surface
        tables = [
            Table(
                True,
                len(level.mesh.vertices) + skin.vertex_count < FEWEST_OF_SKIN,
                level.skins[i].ints,
                level.skins[i].floats,
            )
            for level in asset.levels
        ]
        found.append(
            ExportedMesh(
                surface.name or f"{name}.skin{i}",
                number,
                -1,
                skin.vertex_count,
                np.asarray(surface.triangles, dtype=np.int32),
                tables,
                _uv_of(surface.visual, skin.vertex_count),
            )
        )
    if found or not len(asset.mesh.surface):
        return found
    for level, each in enumerate(asset.levels):
        vertices, triangles = split_at_creases(each.mesh.vertices, each.mesh.surface, CREASE)
        is_serial = len(vertices) < FEWEST_OF_SURFACE
        table = Table(False, is_serial, render_table(vertices, triangles), np.zeros(1, dtype=np.float32))
        found.append(
            ExportedMesh(
                f"{name}.surface{level or ''}",
                number,
                level,
                len(vertices),
                np.asarray(triangles, dtype=np.int32),
                [table],
                np.zeros((0, 2), dtype=np.float32),
            )
        )
    return found


def _uv_of(visual: Any, count: int) -> NDArray[np.float32]:
    uv = getattr(visual, "uv", None)
    return (
        np.zeros((0, 2), dtype=np.float32) if uv is None or len(uv) != count else np.asarray(uv, np.float32)
    )
