"""What is drawn of the bodies of an asset: its skins, or its surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.bodies.kernels.render_mesh import write_render_mesh
from taichi_soft.bodies.kernels.skin import write_skin
from taichi_soft.bodies.render_mesh import FEWEST_SHARED as FEWEST_OF_SURFACE
from taichi_soft.bodies.render_mesh import render_table
from taichi_soft.bodies.skin_mesh import FEWEST_SHARED as FEWEST_OF_SKIN
from taichi_soft.meshing.creases import split_at_creases

CREASE = 40.0
"""Angle [degrees] from which on an edge of a surface is drawn sharp."""


@dataclass(frozen=True, eq=False)
class ExportedMesh:
    """One of the meshes of an asset, with what the kernel that draws it reads."""

    name: str
    asset: int
    is_skin: bool
    is_serial: bool
    vertex_count: int
    triangles: NDArray[np.int32]  # (m, 3)
    ints: NDArray[np.int32]
    floats: NDArray[np.float32]  # of a skin
    uv: NDArray[np.float32]  # (k, 2), or none

    @property
    def kernel(self) -> tuple[str, Any]:
        """Its name in the world file, and the kernel."""
        name, kernel = (
            ("write_skin", write_skin) if self.is_skin else ("write_render_mesh", write_render_mesh)
        )
        return (name if self.is_serial else f"{name}_shared"), kernel


def meshes_of(number: int, asset: SoftBodyAsset, name: str) -> list[ExportedMesh]:
    """Of the asset that has this number: its skins, or else its surface, if it has triangles."""
    found = []
    for i, skin in enumerate(asset.skins):
        surface = skin.surface
        n = len(asset.mesh.vertices)
        found.append(
            ExportedMesh(
                surface.name or f"{name}.skin{i}",
                number,
                True,
                n + skin.vertex_count < FEWEST_OF_SKIN,
                skin.vertex_count,
                np.asarray(surface.triangles, dtype=np.int32),
                skin.ints,
                skin.floats,
                _uv_of(surface.visual, skin.vertex_count),
            )
        )
    if not found and len(asset.mesh.surface):
        vertices, triangles = split_at_creases(asset.mesh.vertices, asset.mesh.surface, CREASE)
        found.append(
            ExportedMesh(
                f"{name}.surface",
                number,
                False,
                len(vertices) < FEWEST_OF_SURFACE,
                len(vertices),
                np.asarray(triangles, dtype=np.int32),
                render_table(vertices, triangles),
                np.zeros(1, dtype=np.float32),
                np.zeros((0, 2), dtype=np.float32),
            )
        )
    return found


def _uv_of(visual: Any, count: int) -> NDArray[np.float32]:
    uv = getattr(visual, "uv", None)
    return (
        np.zeros((0, 2), dtype=np.float32) if uv is None or len(uv) != count else np.asarray(uv, np.float32)
    )
