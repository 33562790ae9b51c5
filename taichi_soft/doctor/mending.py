"""Repair a surface: remove degenerate and duplicate triangles, and turn all other triangles outwards."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_soft.cages.solid import Solid, solid_of
from taichi_soft.core.errors import MeshError
from taichi_soft.doctor.triangle_facts import NO_AREA
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.io import SURFACES
from taichi_soft.meshing.surface import Surface, joined
from taichi_soft.meshing.surfaces import UP

VOXELS = 96
"""Number of voxels along the longest side of a surface. Each voxel is inside or outside the solid."""

ROUNDS = 3

PROBES = (1.0, 2.0, 4.0, 8.0)
"""Distances from a triangle at which the solid is sampled, in front of and behind the triangle [voxels]."""


def write_mended(surfaces: tuple[Surface, ...], path: Path) -> tuple[int, int]:
    """Write surfaces without degenerate and duplicate triangles, all facing outwards.

    Vertices and holes are unchanged. The default axis of the file format points up.
    Returns: the number of removed triangles, and the number of flipped triangles.
    Raises: MeshError for a path that trimesh cannot write to.
    """
    import trimesh  # slow to import

    if path.suffix.lower() not in SURFACES:
        raise MeshError(f"{path.name}: unknown surface format {path.suffix!r}: use {', '.join(SURFACES)}")
    starts = np.cumsum([0, *(len(each.vertices) for each in surfaces)])
    vertices, triangles = joined(surfaces)
    size = float(np.ptp(vertices[np.unique(triangles)], axis=0).max())
    kept = _kept(vertices[triangles], triangles, size)
    faces, turned = triangles[kept], np.zeros(int(kept.sum()), dtype=np.bool_)
    for _ in range(ROUNDS):  # each round makes the inside test of the next round more accurate
        inward = _faces_inward(vertices[faces], solid_of(vertices, faces, size / VOXELS))
        faces[inward], turned = faces[inward][:, ::-1], turned ^ inward
    up = UP[path.suffix.lower()]
    scene, owner = trimesh.Scene(), np.searchsorted(starts, faces[:, 0], side="right") - 1
    for number, surface in enumerate(surfaces):
        mine = faces[owner == number] - starts[number]
        points = surface.vertices if up == "z" else surface.vertices[:, [0, 2, 1]] * (1.0, 1.0, -1.0)
        mesh = trimesh.Trimesh(points, mine, process=False, visual=surface.visual)
        scene.add_geometry(mesh, node_name=surface.name or f"mesh {number}")
    whole = scene if path.suffix.lower() in (".glb", ".gltf") else scene.to_geometry()
    temporary = path.with_name(f".{os.getpid()}.{path.name}")
    try:
        whole.export(temporary)
        os.replace(temporary, path)
    except OSError as error:
        raise MeshError(f"{path.name}: cannot be written ({error.strerror or error})") from None
    finally:
        temporary.unlink(missing_ok=True)
    return int((~kept).sum()), int(turned.sum())


def _kept(corners: FloatArray, triangles: NDArray[np.int64], size: float) -> NDArray[np.bool_]:
    """Return True for triangles that have non-zero area and do not repeat an earlier triangle, bool (m,)."""
    doubled = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    first = np.zeros(len(triangles), dtype=np.bool_)
    first[np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)[1]] = True
    return np.asarray(first & (doubled > NO_AREA * size**2))


def _faces_inward(corners: FloatArray, solid: Solid) -> NDArray[np.bool_]:
    """Return True for triangles with more solid in front than behind, bool (m,)."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals *= solid.spacing / np.linalg.norm(normals, axis=1, keepdims=True)
    middles = corners.mean(axis=1)
    top = np.array(solid.fill.shape) - 1

    def fill_at(points: FloatArray) -> FloatArray:
        voxels = np.clip(((points - solid.origin) / solid.spacing).astype(np.int64), 0, top)
        return np.asarray(solid.fill[tuple(voxels.T)])

    before = sum(fill_at(middles + away * normals) for away in PROBES)
    behind = sum(fill_at(middles - away * normals) for away in PROBES)
    return np.asarray(before > behind)
