"""A built world written as a folder for the native library, whole or not at all."""

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
from taichi_soft.export.axes import axes_of
from taichi_soft.export.description import description_of
from taichi_soft.export.machine_code import compile_kernels, platforms_of
from taichi_soft.export.meshes import meshes_of
from taichi_soft.export.module import kernels_of
from taichi_soft.export.refusals import require_native
from taichi_soft.export.web import write_package
from taichi_soft.solver.context import WorldContext
from taichi_soft.world.world import World, context_of_world, force_field_of

WORLD, KERNELS = "world.tsw", "kernels"
"""Names in the folder."""


@dataclass(frozen=True)
class ExportReport:
    """What was written."""

    path: Path  # of the folder
    size: int  # of all files [bytes]
    kernels: int  # number of them
    names: dict[str, list[str]]  # of bodies, assets, colliders, frames, joints, motors, meshes


def export_world(
    world: World,
    path: str | Path,
    *,
    axes: str = "z-up",
    names: Mapping[Any, str] | None = None,
    platforms: Sequence[str] | None = None,
    static: bool = False,
) -> ExportReport:
    """Write a built world, as it is now, as a folder that the native library loads.

    It ends what this process can do with Taichi: worlds can be asked nothing any more.
    Args:
        path: of the folder, which must not be there yet, or be an earlier one.
        axes: of the engine, see `AXES`.
        names: of bodies, assets, colliders, frames, joints and motors, by which the game finds them; others
            get one with their number, such as body3.
        platforms: some of `PLATFORMS`, that the world is to run on; by default the one of this machine.
        static: write objects that the game is linked with, where it may open no code: see
            `ts_scene_load_linked`.
        world: built, at the state in which the game starts.
    Raises: StateError for a world that is not built; OptionError for a path that is taken or cannot be
        written, for an unknown platform, for the web where it is static, and for what the native library does
        not run, by name; MissingExtraError without llvmlite or zig.
    """
    path, matrix, platforms = Path(path), axes_of(axes), platforms_of(platforms)
    if static and "web" in platforms:
        raise OptionError("a world for the web has the library in it already: leave static out for it")
    if not world.is_built:
        raise StateError("the world is not built: call world.build() before it is exported")
    context = context_of_world(world)
    require_native(context, has_force_field=force_field_of(world) is not None)
    if path.exists() and not (path / WORLD).is_file():
        raise OptionError(f"{path} is there and no world file: give another --out")
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


def _told_apart(names: list[str]) -> list[str]:
    """Names of which none is there twice: later ones get their number behind them."""
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
    names = {kind: _told_apart(each) for kind, each in names.items()}
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
