"""Surfaces as an artist makes them: triangles with whatever belongs to them, in the order of their file."""

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
from taichi_soft.meshing.io import SURFACES, refuse_stand_in
from taichi_soft.meshing.off import read_off
from taichi_soft.meshing.ply import read_ply
from taichi_soft.meshing.stl import read_stl
from taichi_soft.meshing.surface import Surface, surface_of, unit, vertex_normals
from taichi_soft.meshing.wavefront import read_obj

if TYPE_CHECKING:
    import trimesh

Up = Literal["y", "z"]

UP: dict[str, Up] = {".glb": "y", ".gltf": "y", ".obj": "y", ".ply": "z", ".stl": "z", ".off": "z"}
"""Axis that points up in files of each format. glTF defines it; for the others it is what programs write that
say: Blender's exporters by default, and of .off files OpenSCAD and FreeCAD."""

DEFINED = (".glb", ".gltf")
"""Formats that say which axis it is."""

FAR = 1e-4
"""Of the size of a surface, which float32 can no longer tell apart as far from the origin as it lies."""


def read_surfaces(
    source: Any, up: Up | None = None, *, center: bool = False, scale: float = 1.0
) -> tuple[Surface, ...]:
    """The triangle meshes of a file or an object, none left out, each with its own vertices.

    Vertices have the order of the file. In files that index texture coordinates, normals or colours by the
    corner of a face (.obj, some .ply and .off), a vertex has copies where these differ: they come behind all
    others, by vertex, and those of one vertex in the order of their first corners. The several meshes of an
    .obj file, one for each material, have those of its vertices that they use.

    Args:
        source: path of a .glb, .gltf, .obj, .ply, .stl or .off file, a trimesh.Trimesh, a trimesh.Scene,
            (vertices (n, 3) [m], triangles (m, 3)), or several of these in a tuple.
        up: axis that points up in it; None takes what `UP` has for a file, and "z" for all else. What comes
            back has z up.
        center: move the middle of the box round it to the origin.
        scale: factor from its unit to metres, from 0.001 for millimetres.
    Raises: MeshError for what has no triangles or cannot be read, with the file's name; OptionError for an
        unknown axis, a scale that is not positive, and a path that names no file.
    """
    if up not in (None, "y", "z"):
        raise OptionError(f"up must be 'y', 'z' or None, got {up!r}")
    if not isinstance(center, (bool, np.bool_)):
        raise OptionError(f"center must be True or False, got {center!r}")
    return _placed(tuple(_all(source, up)), bool(center), as_positive(scale, "scale", "(1 for metres)"))


def assumed_up(source: Any) -> str:
    """A sentence on the axis that is taken as up in a file whose format does not say, and on the other one;
    nothing for all else."""
    suffix = Path(source).suffix.lower() if isinstance(source, (str, os.PathLike)) else ""
    if suffix in DEFINED or suffix not in UP:
        return ""
    other = "z" if UP[suffix] == "y" else "y"
    return (
        f"{UP[suffix]} is taken as up, as in most {suffix} files: if it lies on its side, choose up={other!r}"
    )


def _all(source: Any, up: Up | None) -> Iterator[Surface]:
    """Surfaces of all sources in turn, z up."""
    if isinstance(source, Surface):
        yield source
    elif isinstance(source, (tuple, list)) and source and not _are_arrays(source):
        for each in source:
            yield from _all(each, up)
    elif isinstance(source, (str, os.PathLike)):
        path = as_path(source)
        found = _read(path)
        yield from (_turned(_with_sound_normals(each), up or UP[path.suffix.lower()]) for each in found)
    else:
        yield from (_turned(_with_sound_normals(each), up or "z") for each in _surfaces(source, ""))


def _are_arrays(source: Any) -> bool:
    return len(source) == 2 and all(hasattr(part, "__len__") and not isinstance(part, str) for part in source)


def _read(path: Path) -> list[Surface]:
    """Surfaces of a file, in its own axes and units.

    Raises: MeshError in one line that begins with the name of the file.
    """
    suffix = path.suffix.lower()
    if suffix not in SURFACES:
        raise MeshError(f"{path.name}: unknown surface format {path.suffix!r}: use {', '.join(SURFACES)}")
    if not path.is_file():
        raise MeshError(f"{path.name}: cannot be read (no such file)")
    try:
        refuse_stand_in(path)
        found = READERS[suffix](path)
    except MeshError as error:
        words = str(error).removeprefix(f"{path.name}: ")
        raise MeshError(f"{path.name}: {words}") from None
    except Exception as error:  # damaged files: each format's reader raises something else
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
"""By format, what reads its surfaces, in the axes and the unit of the file."""


def _surfaces(source: Any, name: str) -> list[Surface]:
    if hasattr(source, "geometry") and hasattr(source, "graph"):
        return _of_scene(source)
    if hasattr(source, "vertices") and hasattr(source, "faces"):
        return [_surface(source, str(source.metadata.get("name", name)))]
    if isinstance(source, (tuple, list)) and len(source) == 2:
        return [surface_of(name, source[0], source[1])]
    raise MeshError(
        "a surface is the path of a file, a trimesh.Trimesh or Scene, or (vertices, triangles), got "
        f"{type(source).__name__}"
    )


def _of_scene(scene: trimesh.Scene) -> list[Surface]:
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
    # Those that it was given, if any: copies of a vertex at a seam of the texture share them.
    with _silent(logging.getLogger("trimesh.util")):
        normals = np.asarray(mesh.vertex_normals, dtype=np.float64)
    return surface_of(name, mesh.vertices, mesh.faces, normals=normals, visual=mesh.visual)


@contextlib.contextmanager
def _silent(log: logging.Logger) -> Iterator[None]:
    """While normals are computed without scipy: trimesh writes a traceback, and does it in another way."""
    was, log.disabled = log.disabled, True
    try:
        yield
    finally:
        log.disabled = was


def _with_sound_normals(surface: Surface) -> Surface:
    """Normals that point away from all triangles round their vertex are computed from these.

    Not where it is the triangles that face inwards: most normals disagree, and the volume is negative.
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
        told = f"its triangles face inwards, against {count:,} of its {all_:,} normals: the normals are kept"
        return replace(surface, notes=(*surface.notes, told))
    normals = surface.normals.copy()
    normals[is_wrong] = vertex_normals(surface.vertices, surface.triangles)[is_wrong]
    told = f"{count:,} of its {all_:,} normals point away from all triangles round them: computed anew"
    return replace(surface, normals=read_only(normals), notes=(*surface.notes, told))


def _turned(surface: Surface, up: Up) -> Surface:
    """With z up."""
    if up == "z":
        return surface
    vertices, normals = (
        read_only(np.stack([rows[:, 0], -rows[:, 2], rows[:, 1]], axis=1))
        for rows in (surface.vertices, surface.normals)
    )
    return replace(surface, vertices=vertices, normals=normals)


def _placed(surfaces: tuple[Surface, ...], center: bool, scale: float) -> tuple[Surface, ...]:
    """Moved to the origin and scaled, in float64; with a note where float32 will not do."""
    if not surfaces:
        return surfaces
    low, high = _box(surfaces)
    middle = 0.5 * (low + high) if center else np.zeros(3)
    place = scale * float(np.abs([low - middle, high - middle]).max())
    apart = float(np.spacing(np.float32(place)))
    notes: tuple[str, ...] = ()
    if center:
        words = ", ".join(f"{part:.10g}" for part in scale * middle)
        notes = (f"its middle lay at ({words}) m, and is the origin now",)
    elif apart > FAR * scale * (high - low).max():
        notes = (
            f"it lies {place:.4g} m from the origin, where 32-bit numbers are {apart:.2g} m apart: "
            "center=True moves it to the origin",
        )
    if not center and scale == 1.0:
        return tuple(_told(each, notes) for each in surfaces)
    moved = (read_only(scale * (each.vertices - middle)) for each in surfaces)
    return tuple(
        _told(replace(each, vertices=vertices), notes) for each, vertices in zip(surfaces, moved, strict=True)
    )


def _told(surface: Surface, notes: tuple[str, ...]) -> Surface:
    """With those of the notes that it lacks."""
    new = tuple(note for note in notes if note not in surface.notes)
    return replace(surface, notes=(*surface.notes, *new)) if new else surface


def _box(surfaces: tuple[Surface, ...]) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest corner of the box round all vertices that triangles use, (3,) each."""
    corners = [each.vertices[each.triangles].reshape(-1, 3) for each in surfaces]
    low, high = (np.array([f(rows, axis=0) for rows in corners]) for f in (np.min, np.max))
    return low.min(axis=0), high.max(axis=0)
