"""Simulate a scene and write its meshes into a file."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from engine_adapter import EngineAdapter
from taichi_soft.bake.clip import Take
from taichi_soft.bake.formats import FORMATS, Format
from taichi_soft.bake.gltf import Interpolation
from taichi_soft.bake.recording import Progress, Scene, frames_in, record, steps_of
from taichi_soft.bake.room import Room
from taichi_soft.bake.vertex_texture import fits_texture, is_vat
from taichi_soft.core.checks import LARGEST_COUNT, as_number, as_path, as_positive
from taichi_soft.core.errors import BakeError, OptionError
from taichi_soft.core.extras import require_extra
from taichi_soft.core.part_folder import PartFolder
from taichi_soft.world.world import World

MEGABYTE = 1e6


@dataclass(frozen=True)
class BakeReport:
    """Result of a bake."""

    path: Path  # path of the file or folder
    frames: int  # number of frames
    fps: float  # frames per second of the clip
    meshes: tuple[str, ...]  # names of the meshes
    vertices: int  # number of vertices of all meshes
    size: int  # total size of the files [bytes]
    left_out: tuple[str, ...]  # names of bodies without triangles


def bake(
    scene: Scene,
    out: str | Path,
    *,
    seconds: float,
    fps: float = 30.0,
    interpolation: Interpolation = "linear",
    limit: float = 1000.0,
    on_room: Callable[[Room], object] | None = None,
    on_frame: Progress | None = None,
) -> BakeReport:
    """Simulate a scene and write the meshes of all bodies and their motion into one file.

    Frames are `1 / fps` apart. The first frame is the initial state, and the last frame is the state after
    `seconds`. Each frame is the exact state after a fixed step: a world makes the same integer number of
    steps for each frame, and at least 60 steps per second.
    Args:
        scene: a world, which is built if needed, or an `EngineAdapter`, whose step length and `before_step`
            are used. The simulation continues from the current state.
        out: .glb (glTF 2.0, morph targets), .npz (point cache), .vat (a folder: vertex-animation texture,
            mesh, shaders) or .usdc (USD). An existing file is replaced when the bake is complete.
        seconds: length of the clip [s].
        fps: frames per second.
        interpolation: interpolation between frames of a .glb: "linear" or "step".
        limit: largest size of the file [MB], estimated from the number of vertices and frames.
        on_room: called once with the estimated size, before anything moves.
        on_frame: called with (frames made, total frames) after each frame.
    Returns: a report with the names and the size of the written meshes.
    Raises: OptionError for a value out of range, for a file larger than `limit`, and for frames between an
        adapter's steps; MissingExtraError without the packages that the format needs; StateError, which
        names the frame, for a body that is cut or torn during the bake; MeshError if no body has triangles;
        BakeError if the file cannot be written. After an error, no file is written.
    """
    path = as_path(out)
    form = _format_of(path)
    length, rate = as_positive(seconds, "seconds", "s"), as_number(fps, "fps", 1e-3, 1e4)
    most = as_positive(limit, "limit", "MB")
    if interpolation not in ("linear", "step"):
        raise OptionError(f"interpolation must be 'linear' or 'step', got {interpolation!r}")
    if not isinstance(scene, (World, EngineAdapter)):
        raise OptionError(f"scene must be a World or an EngineAdapter, got {type(scene).__name__}")
    if length * rate > LARGEST_COUNT:
        raise OptionError(f"seconds is {length:g} at {rate:g} per second: at most {LARGEST_COUNT:,} frames")
    count = frames_in(length, rate)
    steps_of(scene, rate)
    _require_place(path)
    asked: list[Room] = []

    def require_room(vertices: int) -> None:
        room = Room(count, vertices, form.size(count, vertices))
        form.require(count, vertices)
        _require_limit(room, most, path)
        if not asked and on_room:
            on_room(room)
        asked.append(room)

    with _part_folder(path) as part:
        if isinstance(scene, World) and not scene.is_built:
            scene.build()
        take = record(scene, count, rate, require_room, on_frame)
        size = _write(take, form, part, path, interpolation)
    names = tuple(clip.name for clip in take.clips)
    return BakeReport(path, count, rate, names, take.vertex_count, size, take.left_out)


def _format_of(path: Path) -> Format:
    form = FORMATS.get(path.suffix.lower())
    if form is None or not path.stem:
        raise OptionError(f"cannot bake into {str(path)!r}: name a file that ends in {', '.join(FORMATS)}")
    if form.needs:
        require_extra(form.needs[0], f"a {path.suffix.lower()} file needs", *form.needs[1:])
    return form


def _require_place(path: Path) -> None:
    """Raise a BakeError if there is a file or folder at `path` that a bake must not replace."""
    wants_folder = path.suffix.lower() == ".vat"
    if path.is_dir() and not (wants_folder and (is_vat(path) or not any(path.iterdir()))):
        raise BakeError(f"cannot write {path}: the folder is not a .vat: choose another path, or remove it")
    if wants_folder and path.is_file():
        raise BakeError(
            f"cannot write {path}: a .vat is a folder, and this is a file: choose another path, or remove it"
        )


def _require_limit(room: Room, limit: float, path: Path) -> None:
    if room.size > limit * MEGABYTE:
        is_vat_less = path.suffix.lower() != ".vat" and fits_texture(room.frames, room.vertices)
        smaller = ", into .vat (9 bytes per vertex and frame, not 24)" if is_vat_less else ""
        raise OptionError(
            f"{path.name} would hold {room}, above the limit of {limit:g} MB: bake fewer --seconds or --fps, "
            f"a coarser mesh{smaller}, or give a limit of {room.size / MEGABYTE + 1:.0f}"
        )


@contextmanager
def _part_folder(path: Path) -> Iterator[Path]:
    """Return a context with a temporary folder next to `path`, which is removed at the end."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part = PartFolder(path.parent)
    except OSError as error:
        raise BakeError(f"cannot write {path}: {error.strerror or error}") from error
    try:
        yield part.path
    finally:
        part.remove()


def _write(take: Take, form: Format, part: Path, path: Path, interpolation: Interpolation) -> int:
    """Write into the temporary folder, and move the complete result to `path`. Returns: the size [bytes]."""
    try:
        made = part / f"bake{path.suffix.lower()}"
        form.write(take, made, interpolation)
        files = [each for each in made.rglob("*") if each.is_file()] if made.is_dir() else [made]
        size = sum(each.stat().st_size for each in files)
        _move(made, path, part / "old")
    except OSError as error:
        raise BakeError(f"cannot write {path}: {error.strerror or error}") from error
    return size


def _move(made: Path, path: Path, old: Path) -> None:
    """Move a complete result to `path`.

    If `path` is a folder, keep files that a bake did not write, such as Godot's import settings.
    """
    if not path.is_dir():
        made.replace(path)
        return
    for each in path.iterdir():
        if each.is_file() and not (made / each.name).exists():
            shutil.copy2(each, made / each.name)
    path.rename(old)
    try:
        made.rename(path)
    except OSError:
        old.rename(path)
        raise
