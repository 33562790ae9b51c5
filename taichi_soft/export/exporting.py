"""Write a built world as a folder for the native library. A failed export leaves no files."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from taichi_soft.bodies.fields import made_fields
from taichi_soft.control.frames import Frames
from taichi_soft.control.joints import Joints
from taichi_soft.control.motors import Motors
from taichi_soft.core.errors import OptionError, StateError
from taichi_soft.core.extras import require_extra
from taichi_soft.core.part_folder import PartFolder
from taichi_soft.core.runtime import export_kernels
from taichi_soft.export.archive import words, written
from taichi_soft.export.description import description_of
from taichi_soft.export.engine_axes import axes_of
from taichi_soft.export.machine_code import compile_kernels, platforms_of
from taichi_soft.export.meshes import meshes_of
from taichi_soft.export.module import kernels_of
from taichi_soft.export.refusals import require_native
from taichi_soft.export.web import write_package
from taichi_soft.solver.context import WorldContext
from taichi_soft.world.world import World, context_of_world, force_field_of

WORLD, KERNELS = "world.tsw", "kernels"
"""Names of the world file, and of the folder with the machine code of the kernels."""


@dataclass(frozen=True)
class ExportReport:
    """Result of an export."""

    path: Path  # path of the folder
    size: int  # total size of the files [bytes]
    kernels: int  # number of kernels
    names: dict[str, list[str]]  # names by kind: bodies, assets, colliders, frames, joints, motors, meshes


def export_world(
    world: World,
    path: str | Path,
    *,
    axes: str = "z-up",
    names: Mapping[Any, str] | None = None,
    platforms: Sequence[str] | None = None,
    static: bool = False,
) -> ExportReport:
    """Write the current state of a built world as a folder that the native library loads.

    After an export, this process cannot use Taichi or its worlds any more. Start a new process.
    Args:
        world: built world in the initial state of the game.
        path: path of the folder. An earlier export there is replaced.
        axes: axes of the engine, a name in `AXES`.
        names: names for bodies, assets, colliders, frames, joints and motors in the game. An object without a
            name is named by its kind and index, such as body3.
        platforms: names in `PLATFORMS`. None means the platform of this machine.
        static: True writes object files to link into the game, for systems that forbid loading code at run
            time. See `ts_scene_load_linked`.
    Raises: StateError for a world that is not built; OptionError for a path that is in use or cannot be
        written, for an unknown platform, for `static` with the platform "web", or for features that the
        native library does not support; MissingExtraError if llvmlite or zig is not installed.
    """
    path, matrix, platforms = Path(path), axes_of(axes), platforms_of(platforms)
    if static and "web" in platforms:
        raise OptionError("a world for the web already contains the library: leave out static")
    if not world.is_built:
        raise StateError("the world is not built: call world.build() before export_world(world)")
    context = context_of_world(world)
    require_native(context, has_force_field=force_field_of(world) is not None)
    if path.exists() and not (path / WORLD).is_file():
        raise OptionError(f"{path} exists and is not a world file: choose another --out")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part = PartFolder(path.parent)
    except OSError as error:
        raise OptionError(f"cannot write {path}: {error.strerror}") from error
    try:
        require_extra("export", "an export needs")
        return _written(context, path, part, matrix, dict(names or {}), platforms, static)
    finally:
        part.remove()


def _made_unique(names: list[str]) -> list[str]:
    """Return unique names, by appending a number to each repeated name."""
    found: list[str] = []
    for i, name in enumerate(names):
        found.append(f"{name}#{i}" if name in found else name)
    return found


def _written(
    context: WorldContext,
    path: Path,
    part: PartFolder,
    matrix: Any,
    given: dict[Any, str],
    platforms: Sequence[str],
    static: bool,
) -> ExportReport:
    assets = context.slots.kinds
    names = {
        "asset": [given.get(each, f"asset{i}") for i, each in enumerate(assets)],
        "body": [
            f"body{i}" if each is None else given.get(each, f"body{i}")
            for i, each in enumerate(context.slots.slots)
        ],
        "collider": [given.get(each, f"collider{i}") for i, each in enumerate(context.colliders.all_handles)],
        "frame": [
            f"frame{i}" if each is None else given.get(each, f"frame{i}")
            for i, each in enumerate(context.of(Frames).rows)
        ],
    }
    for kind, handles in (("joint", context.of(Joints).by_number), ("motor", context.of(Motors).by_number)):
        numbers = range(max(handles, default=-1) + 1)
        names[kind] = [given.get(handles.get(i), f"{kind}{i}") for i in numbers]
    meshes = [mesh for i, asset in enumerate(assets) for mesh in meshes_of(i, asset, names["asset"][i])]
    names["mesh"] = [mesh.name for mesh in meshes]
    names = {kind: _made_unique(each) for kind, each in names.items()}
    arrays = description_of(context, meshes, names, matrix)
    kernels = kernels_of(context, meshes)
    new = part.path / path.name
    folder = new / KERNELS
    folder.mkdir(parents=True)
    texts = part.path / "texts"
    texts.mkdir()
    export_kernels(texts, kernels, [each.particle_position for each in made_fields()])
    compiled = compile_kernels(texts, list(kernels), platforms, folder, path.stem if static else None)
    contents = [each.read_bytes() for each in compiled.files]
    arrays["kernels/names"] = words(list(kernels))
    arrays["kernels/stamp"] = words([compiled.stamp])
    arrays["kernels/files"] = words([each.name for each in compiled.files])
    arrays["kernels/sums"] = np.array([(len(each), zlib.crc32(each)) for each in contents], dtype=np.int64)
    if any(each.suffix == ".wasm" for each in compiled.files):
        write_package(new)
    (new / WORLD).write_bytes(written(arrays))
    size = sum(each.stat().st_size for each in new.rglob("*") if each.is_file())
    if path.exists():
        path.rename(part.path / "before")
    try:
        new.rename(path)
    except OSError:
        (part.path / "before").rename(path)
        raise
    return ExportReport(path, size, len(kernels), names)
