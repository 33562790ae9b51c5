"""Check mesh files that visitors upload, in a separate process."""

from __future__ import annotations

import re
import shutil
from collections.abc import Collection
from itertools import chain, count
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path

from taichi_soft.bake.axes import y_up
from taichi_soft.core.errors import MeshError, OptionError
from taichi_soft.live.guard import LARGEST_UPLOAD
from taichi_soft.meshing.surface import Surface
from taichi_soft.meshing.surfaces import UP, Up

KINDS = (".glb", ".obj", ".ply", ".stl", ".off")
"""Self-contained file formats. A .gltf could refer to other files on the server."""

MOST_SECONDS = 60.0
"""Largest time for making tetrahedra from a visitor's file [s]."""

MOST_TRIANGLES = 200_000


def require_mesh(
    folder: Path, name: str, content: bytes, taken: Collection[str] = (), up: Up | None = None
) -> Path:
    """Store a visitor's file in a new folder and return its path, if it can be made into a body.

    Args:
        folder: folder to create for this file.
        name: the visitor's file name. Folders, and characters except letters, digits, - and _ are removed.
        taken: names in use; a number is appended to a name that is taken.
        up: axis that points up in the file. If it is not the default of the format, the file is stored as
            .glb.
    Raises: OptionError for a file that is too large or of another format; MeshError for a file that
        cannot be made into a body.
    """
    suffix = Path(name).suffix.lower()
    if suffix not in KINDS:
        raise OptionError(f"{name!r} has the wrong format: use {', '.join(KINDS)}")
    if not 0 < len(content) <= LARGEST_UPLOAD:
        raise OptionError(f"{name!r} has {len(content):,} bytes: from 1 to {LARGEST_UPLOAD:,} are accepted")
    own = re.sub(r"[^A-Za-z0-9_-]", "", Path(name).stem)[:40] or "mesh"
    stem = next(each for each in chain([own], (f"{own[:36]}{i}" for i in count(2))) if each not in taken)
    folder.mkdir(parents=True)
    path = folder / f"{stem}{suffix}"
    path.write_bytes(content)
    spawning = get_context("spawn")
    mine, theirs = spawning.Pipe(duplex=False)
    process = spawning.Process(target=_look_at, args=(str(path), up, theirs), daemon=True)
    process.start()
    theirs.close()
    try:
        words = mine.recv() if mine.poll(MOST_SECONDS) else f"it took longer than {MOST_SECONDS:g} s"
    except EOFError:
        words = "the process that read it crashed"
    process.kill()
    process.join()
    if words:
        shutil.rmtree(folder, ignore_errors=True)
        raise MeshError(f"{name!r} cannot be made into a body: {words}")
    turned = path.with_suffix(".glb")
    return turned if turned.is_file() else path


def _look_at(path: str, up: Up | None, connection: Connection) -> None:
    """Make a body from a file. If `up` is not the default axis of the format, write the file as .glb.

    Send an empty string if this succeeds, else the reason for the failure.
    """
    from taichi_soft.bodies.asset import SoftBodyAsset
    from taichi_soft.live.choices import VISITOR

    try:
        asset = SoftBodyAsset.from_surface(Path(path), VISITOR, up=up)
        triangles = sum(len(skin.surface.triangles) for skin in asset.skins)
        if triangles > MOST_TRIANGLES:
            connection.send(f"it has {triangles:,} triangles: use at most {MOST_TRIANGLES:,}")
        elif max(asset.mesh.bounds[1] - asset.mesh.bounds[0]) > 20.0:
            connection.send("it is larger than 20 m: scale it to metres")
        else:
            if up not in (None, UP[Path(path).suffix]):
                _write_glb(asset.skin, Path(path).with_suffix(".glb"))
            connection.send("")
    except Exception as error:
        connection.send(str(error) or type(error).__name__)


def _write_glb(surfaces: tuple[Surface, ...], path: Path) -> None:
    import trimesh  # imported here because it is slow

    scene = trimesh.Scene()
    for number, each in enumerate(surfaces):
        mesh = trimesh.Trimesh(
            y_up(each.vertices),
            each.triangles,
            vertex_normals=y_up(each.normals),
            visual=each.visual,
            process=False,
        )
        scene.add_geometry(mesh, node_name=f"mesh {number}")
    path.write_bytes(scene.export(file_type="glb", include_normals=True))
