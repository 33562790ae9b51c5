"""Surfaces from files and programs: triangles with their normals and appearance, in the order of the file."""

from __future__ import annotations

import contextlib
import logging
import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from taichi_soft.core.checks import as_path, as_positive
from taichi_soft.core.errors import MeshError, OptionError
from taichi_soft.meshing.arrays import FloatArray, read_only
from taichi_soft.meshing.gltf import read_gltf
from taichi_soft.meshing.io import SURFACES, reject_placeholder
from taichi_soft.meshing.off import read_off
from taichi_soft.meshing.ply import read_ply
from taichi_soft.meshing.stl import read_stl
from taichi_soft.meshing.surface import Surface, surface_of, unit, vertex_normals
from taichi_soft.meshing.wavefront import read_obj

if TYPE_CHECKING:
    import trimesh

Up = Literal["y", "z"]

UP: dict[str, Up] = {".glb": "y", ".gltf": "y", ".obj": "y", ".ply": "z", ".stl": "z", ".off": "z"}
"""Axis that points up in files of each format. glTF defines this axis. For the other formats, it is the
default of common exporters: OpenSCAD and FreeCAD for .off files, and Blender for .obj, .ply and .stl
files."""

DEFINED = (".glb", ".gltf")
"""Suffixes of the formats whose specification defines which axis points up."""

MAX_SPACING = 1e-4
"""Largest spacing of float32 numbers at a surface, as a fraction of the size of the surface. The spacing
grows with the distance from the origin. If it is larger, `read_surfaces` adds a note."""


def read_surfaces(
    source: Any, up: Up | None = None, *, center: bool = False, scale: float = 1.0
) -> tuple[Surface, ...]:
    """Read all triangle meshes of a file or an object, each with its own vertices.

    Vertices have the order of the file. Some files (.obj, some .ply and .off) index texture coordinates,
    normals or colours by the corner of a face. If the corners at a vertex have different values, the vertex
    is copied. Copies follow all other vertices, ordered by vertex and then by their first corners. An .obj
    file has one mesh for each material. Each of these meshes has only the vertices that it uses.

    Args:
        source: path of a .glb, .gltf, .obj, .ply, .stl or .off file, a trimesh.Trimesh, a trimesh.Scene,
            (vertices (n, 3) [m], triangles (m, 3)), or several of these in a tuple.
        up: axis that points up in `source`. None means the axis in `UP` for a file, and "z" for other
            sources. In the result, z is up.
        center: True to move the centre of the bounding box to the origin.
        scale: factor from the unit of `source` to metres, such as 0.001 for millimetres.
    Raises: MeshError, with the file's name, if a source has no triangles or cannot be read; OptionError for
        an unknown axis, a scale that is not positive, or a path that does not name a file.
    """
    if up not in (None, "y", "z"):
        raise OptionError(f"up must be 'y', 'z' or None, got {up!r}")
    if not isinstance(center, (bool, np.bool_)):
        raise OptionError(f"center must be True or False, got {center!r}")
    return _placed(tuple(_all(source, up)), bool(center), as_positive(scale, "scale", "(1 for metres)"))


def assumed_up(source: Any) -> str:
    """Return a message that names the axis assumed to point up in a file, or "" if no axis is assumed."""
    suffix = Path(source).suffix.lower() if isinstance(source, (str, os.PathLike)) else ""
    if suffix in DEFINED or suffix not in UP:
        return ""
    other = "z" if UP[suffix] == "y" else "y"
    return (
        f"{UP[suffix]} is taken as up, as in most {suffix} files: if it lies on its side, pass up={other!r}"
    )


def _all(source: Any, up: Up | None) -> Iterator[Surface]:
    """Yield the surfaces of all sources in order, with z up."""
    if isinstance(source, Surface):
        yield source
    elif isinstance(source, (tuple, list)) and source and not _are_arrays(source):
        for each in source:
            yield from _all(each, up)
    elif isinstance(source, (str, os.PathLike)):
        path = as_path(source)
        found = _read(path)
        yield from (_with_z_up(_with_valid_normals(each), up or UP[path.suffix.lower()]) for each in found)
    else:
        yield from (_with_z_up(_with_valid_normals(each), up or "z") for each in _surfaces(source, ""))


def _are_arrays(source: Any) -> bool:
    return len(source) == 2 and all(hasattr(part, "__len__") and not isinstance(part, str) for part in source)


def _read(path: Path) -> list[Surface]:
    """Read the surfaces of a file, in the axes and units of the file.

    Raises: MeshError in one line that begins with the file's name.
    """
    suffix = path.suffix.lower()
    if suffix not in SURFACES:
        raise MeshError(f"{path.name}: unknown surface format {path.suffix!r}: use {', '.join(SURFACES)}")
    if not path.is_file():
        raise MeshError(f"{path.name}: cannot be read (no such file)")
    try:
        reject_placeholder(path)
        found = READERS[suffix](path)
    except MeshError as error:
        words = str(error).removeprefix(f"{path.name}: ")
        raise MeshError(f"{path.name}: {words}") from None
    except Exception as error:  # readers raise many kinds of exceptions on damaged files
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        raise MeshError(f"{path.name}: cannot be read ({reason})") from None
    if not found:
        raise MeshError(f"{path.name}: there are no triangles in it")
    return found


READERS: dict[str, Callable[[Path], list[Surface]]] = {
    ".glb": read_gltf,
    ".gltf": read_gltf,
    ".obj": read_obj,
    ".off": read_off,
    ".ply": read_ply,
    ".stl": read_stl,
}
"""Reader of each format. A reader returns surfaces in the axes and units of the file."""


def _surfaces(source: Any, name: str) -> list[Surface]:
    if hasattr(source, "geometry") and hasattr(source, "graph"):
        return _of_scene(source)
    if hasattr(source, "vertices") and hasattr(source, "faces"):
        return [_surface(source, str(source.metadata.get("name", name)))]
    if isinstance(source, (tuple, list)) and len(source) == 2:
        return [surface_of(name, source[0], source[1])]
    raise MeshError(
        "a surface must be the path of a file, a trimesh.Trimesh or Scene, or (vertices, triangles), got "
        f"{type(source).__name__}"
    )


def _of_scene(scene: trimesh.Scene) -> list[Surface]:
    found = []
    for node in sorted(scene.graph.nodes_geometry):
        matrix, geometry = scene.graph[node]
        mesh = scene.geometry[geometry]
        if hasattr(mesh, "faces") and len(mesh.faces):
            moved = mesh.copy(include_cache=True)  # keeps the normals of the file
            moved.apply_transform(matrix)
            found.append(_surface(moved, str(node)))
    if not found:
        raise MeshError("there are no triangles in it")
    return found


def _surface(mesh: trimesh.Trimesh, name: str) -> Surface:
    if len(mesh.faces) == 0:
        raise MeshError("there are no triangles in it")
    # Use the normals of the file, if it has any, because copies of a vertex at a texture seam share a normal.
    with _silent(logging.getLogger("trimesh.util")):
        normals = np.asarray(mesh.vertex_normals, dtype=np.float64)
    return surface_of(name, mesh.vertices, mesh.faces, normals=normals, visual=mesh.visual)


@contextlib.contextmanager
def _silent(log: logging.Logger) -> Iterator[None]:
    """Silence a logger. If scipy is missing, trimesh logs a traceback, and then computes normals without
    scipy.
    """
    was, log.disabled = log.disabled, True
    try:
        yield
    finally:
        log.disabled = was


def _with_valid_normals(surface: Surface) -> Surface:
    """Recompute normals that point away from all triangles around their vertex.

    If most normals point away and the volume is negative, the triangles face inwards, and all normals are
    kept.
    """
    corners = surface.vertices[surface.triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    along = np.einsum("mx,mcx->mc", unit(across), surface.normals[surface.triangles])
    has_area = np.abs(across).max(axis=1) > 0.0
    nearest = np.full(len(surface.vertices), -np.inf)
    np.maximum.at(nearest, surface.triangles[has_area].ravel(), along[has_area].ravel())
    is_wrong = (nearest < -1e-6) & np.isfinite(nearest)
    count, all_ = int(is_wrong.sum()), int(np.isfinite(nearest).sum())
    if count == 0:
        return surface
    middle = corners - corners.mean(axis=(0, 1))
    volume = np.einsum("mx,mx->", middle[:, 0], np.cross(middle[:, 1], middle[:, 2]))
    if 2 * count > all_ and volume < 0.0:
        note = f"its triangles face inwards, against {count:,} of its {all_:,} normals: the normals are kept"
        return replace(surface, notes=(*surface.notes, note))
    normals = surface.normals.copy()
    normals[is_wrong] = vertex_normals(surface.vertices, surface.triangles)[is_wrong]
    note = f"{count:,} of its {all_:,} normals point away from all triangles around them: they are recomputed"
    return replace(surface, normals=read_only(normals), notes=(*surface.notes, note))


def _with_z_up(surface: Surface, up: Up) -> Surface:
    """Rotate a surface from `up` to z up."""
    if up == "z":
        return surface
    vertices, normals = (
        read_only(np.stack([rows[:, 0], -rows[:, 2], rows[:, 1]], axis=1))
        for rows in (surface.vertices, surface.normals)
    )
    return replace(surface, vertices=vertices, normals=normals)


def _placed(surfaces: tuple[Surface, ...], center: bool, scale: float) -> tuple[Surface, ...]:
    """Scale surfaces, and move them to the origin if `center` is True.

    If `center` is False and float32 is too coarse at their distance from the origin, add a note.
    """
    if not surfaces:
        return surfaces
    low, high = _box(surfaces)
    middle = 0.5 * (low + high) if center else np.zeros(3)
    distance = scale * float(np.abs([low - middle, high - middle]).max())
    spacing = float(np.spacing(np.float32(distance)))
    notes: tuple[str, ...] = ()
    if center:
        words = ", ".join(f"{part:.10g}" for part in scale * middle)
        notes = (f"its centre was at ({words}) m and is now the origin",)
    elif spacing > MAX_SPACING * scale * (high - low).max():
        notes = (
            f"it lies {distance:.4g} m from the origin, where 32-bit numbers are {spacing:.2g} m apart: "
            "center=True moves it to the origin",
        )
    if not center and scale == 1.0:
        return tuple(_with_notes(each, notes) for each in surfaces)
    moved = (read_only(scale * (each.vertices - middle)) for each in surfaces)
    return tuple(
        _with_notes(replace(each, vertices=vertices), notes)
        for each, vertices in zip(surfaces, moved, strict=True)
    )


def _with_notes(surface: Surface, notes: tuple[str, ...]) -> Surface:
    """Return the surface with `notes` added. Notes that the surface already has are not repeated."""
    new = tuple(note for note in notes if note not in surface.notes)
    return replace(surface, notes=(*surface.notes, *new)) if new else surface


def _box(surfaces: tuple[Surface, ...]) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and highest corner of the bounding box of all vertices in triangles, (3,) each."""
    corners = [each.vertices[each.triangles].reshape(-1, 3) for each in surfaces]
    low, high = (np.array([f(rows, axis=0) for rows in corners]) for f in (np.min, np.max))
    return low.min(axis=0), high.max(axis=0)
