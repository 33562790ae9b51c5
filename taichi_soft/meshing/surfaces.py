"""Surfaces as an artist makes them: triangles with whatever belongs to them, in the order of their file."""

from __future__ import annotations

import contextlib
import logging
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.checks import as_path
from taichi_soft.core.errors import MeshError, OptionError
from taichi_soft.meshing.arrays import FloatArray, IntArray, as_indices, as_points, read_only
from taichi_soft.meshing.gltf import Part, read_gltf
from taichi_soft.meshing.io import SURFACES

if TYPE_CHECKING:
    import trimesh

Up = Literal["y", "z"]

Y_UP = (".glb", ".gltf")
"""Files in which y is up, by their format's definition."""


@dataclass(frozen=True, eq=False)
class Surface:
    """One mesh of a file, or what a program made."""

    name: str
    vertices: FloatArray  # (n, 3) [m]
    triangles: IntArray  # (m, 3)
    normals: FloatArray  # (n, 3), of unit length
    visual: Any = None  # trimesh's: texture coordinates, material, colours; None where there are none
    notes: tuple[str, ...] = ()  # sentences on what the reader assumed, repaired or left out


def read_surfaces(source: Any, up: Up | None = None) -> tuple[Surface, ...]:
    """The triangle meshes of a file or an object, none left out, each with its own vertices in their order.

    Args:
        source: path of a file that trimesh reads (.glb, .gltf, .obj, .ply, .stl, .off), a trimesh.Trimesh, a
            trimesh.Scene, (vertices (n, 3) [m], triangles (m, 3)), or several of these in a tuple.
        up: axis that points up in it; None takes "y" for .glb and .gltf files and "z" for all else. What
            comes back has z up.
    Raises: MeshError for what has no triangles or cannot be read, with the file's name; OptionError for an
        unknown axis and a path that names no file.
    """
    if up not in (None, "y", "z"):
        raise OptionError(f"up must be 'y', 'z' or None, got {up!r}")
    if isinstance(source, Surface):
        return (source,)
    if isinstance(source, (tuple, list)) and source and not _are_arrays(source):
        return tuple(surface for each in source for surface in read_surfaces(each, up))
    if isinstance(source, (str, os.PathLike)):
        path = as_path(source)
        if path.suffix.lower() in Y_UP:
            return tuple(_turned(surface, up or "y") for surface in _of_gltf(path))
        found = _read(path)
        try:
            return tuple(_turned(surface, up or "z") for surface in _surfaces(found, path.name))
        except MeshError as error:
            raise MeshError(f"{path.name}: {error}") from None
    return tuple(_turned(surface, up or "z") for surface in _surfaces(source, ""))


def joined(surfaces: tuple[Surface, ...]) -> tuple[FloatArray, NDArray[np.int64]]:
    """Vertices (n, 3) [m] and triangles (m, 3) of all of them, as of one."""
    starts = np.cumsum([0, *(len(each.vertices) for each in surfaces)])[:-1]
    triangles = [
        each.triangles.astype(np.int64) + start for each, start in zip(surfaces, starts, strict=True)
    ]
    return np.concatenate([each.vertices for each in surfaces]), np.concatenate(triangles)


def _are_arrays(source: Any) -> bool:
    return len(source) == 2 and all(hasattr(part, "__len__") and not isinstance(part, str) for part in source)


def _read(path: Path) -> Any:
    """What trimesh makes of a file."""
    import trimesh  # half a second that a game need not wait for

    if path.suffix.lower() not in SURFACES:
        raise MeshError(f"{path.name}: unknown surface format {path.suffix!r}: use {', '.join(SURFACES)}")
    if not path.is_file():
        raise MeshError(f"{path.name}: cannot be read (no such file)")
    try:
        return trimesh.load_scene(path, process=False, maintain_order=True)
    except Exception as error:  # damaged files: each format's reader raises something else
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        raise MeshError(f"{path.name}: cannot be read ({reason})") from None


def _surfaces(source: Any, name: str) -> list[Surface]:
    if hasattr(source, "geometry") and hasattr(source, "graph"):
        return _of_scene(source, name)
    if hasattr(source, "vertices") and hasattr(source, "faces"):
        return [_surface(source, str(source.metadata.get("name", name)))]
    if isinstance(source, (tuple, list)) and len(source) == 2:
        return [_of_arrays(source[0], source[1], name)]
    raise MeshError(
        "a surface is the path of a file, a trimesh.Trimesh or Scene, or (vertices, triangles), got "
        f"{type(source).__name__}"
    )


def _of_gltf(path: Path) -> list[Surface]:
    """Raises: MeshError, with the file's name."""
    if not path.is_file():
        raise MeshError(f"{path.name}: cannot be read (no such file)")
    try:
        return [_of_part(part) for part in read_gltf(path)]
    except MeshError as error:
        raise MeshError(f"{path.name}: {error}") from None


def _of_part(part: Part) -> Surface:
    surface = _of_arrays(part.vertices, part.triangles, part.name)
    normals = surface.normals
    if part.normals is not None:
        lengths = np.linalg.norm(part.normals, axis=1, keepdims=True)
        normals = read_only(np.where(np.isfinite(lengths) & (lengths > 0.0), _unit(part.normals), normals))
    return replace(surface, normals=normals, visual=part.visual, notes=part.notes)


def _of_scene(scene: trimesh.Scene, name: str) -> list[Surface]:
    found = []
    for node in sorted(scene.graph.nodes_geometry):
        matrix, geometry = scene.graph[node]
        mesh = scene.geometry[geometry]
        if hasattr(mesh, "faces") and len(mesh.faces):
            moved = mesh.copy(include_cache=True)  # with the normals of the file
            moved.apply_transform(matrix)
            found.append(_surface(moved, str(node)))
    if not found:
        raise MeshError("there are no triangles in it")
    return found


def _surface(mesh: trimesh.Trimesh, name: str) -> Surface:
    if len(mesh.faces) == 0:
        raise MeshError("there are no triangles in it")
    surface = _of_arrays(mesh.vertices, mesh.faces, name)
    # Those of the file, where it has any: copies of a vertex at a seam of the texture share them.
    with _silent(logging.getLogger("trimesh.util")):
        normals = _unit(np.asarray(mesh.vertex_normals, dtype=np.float64))
    return Surface(name, surface.vertices, surface.triangles, read_only(normals), mesh.visual)


@contextlib.contextmanager
def _silent(log: logging.Logger) -> Iterator[None]:
    """While normals are computed without scipy: trimesh writes a traceback, and does it in another way."""
    was, log.disabled = log.disabled, True
    try:
        yield
    finally:
        log.disabled = was


def _of_arrays(vertices: Any, triangles: Any, name: str) -> Surface:
    points = as_points(np.asarray(vertices))
    corners = as_indices(np.asarray(triangles), "triangles", 3, len(points), "triangle", may_repeat=True)
    normals = read_only(_normals(points, corners))
    return Surface(name, read_only(points), read_only(corners), normals)


def _normals(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Means of those of the triangles round each vertex, by their angles there, (n, 3)."""
    corners = points[triangles]
    ahead, back = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    across = np.cross(ahead, back)  # along the normal, at each corner
    size = np.linalg.norm(across, axis=2)
    angles = np.where(size > 0.0, np.arctan2(size, np.einsum("tcx,tcx->tc", ahead, back)), 0.0)
    weighed = (angles[:, :, None] * _unit(across)).reshape(-1, 3)
    sums = [np.bincount(triangles.ravel(), weighed[:, k], len(points)) for k in range(3)]
    return _unit(np.stack(sums, axis=1))


def _unit(normals: NDArray[Any]) -> FloatArray:
    lengths = np.linalg.norm(normals, axis=-1, keepdims=True)
    return np.where(lengths > 0, normals / np.where(lengths > 0, lengths, 1.0), [0.0, 0.0, 1.0])


def _turned(surface: Surface, up: Up) -> Surface:
    """With z up."""
    if up == "z":
        return surface
    vertices, normals = (
        read_only(np.stack([rows[:, 0], -rows[:, 2], rows[:, 1]], axis=1))
        for rows in (surface.vertices, surface.normals)
    )
    return replace(surface, vertices=vertices, normals=normals)
