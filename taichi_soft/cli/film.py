"""Command `film`: film a mesh, a world or a stage."""

from __future__ import annotations

import gc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.markup import escape

from taichi_soft.cli.console import Arch, Threads, say
from taichi_soft.cli.filming import Blur, Fps, Out, Seconds, Size, Slow, Stats, make_film, size_of
from taichi_soft.cli.named_function import function_of, variables_of
from taichi_soft.core.checks import as_positive
from taichi_soft.core.errors import MeshError, OptionError
from taichi_soft.core.runtime import init
from taichi_soft.elements.materials import preset
from taichi_soft.meshing.io import SURFACES
from taichi_soft.meshing.surface import joined
from taichi_soft.meshing.surfaces import read_surfaces

if TYPE_CHECKING:
    from taichi_soft.render.stage import Stage

MATERIAL = "gelatine"

SMALLEST, LARGEST, LENGTH = 0.05, 5.0, 1.0
"""SMALLEST, LARGEST: range of a mesh's longest side [m]. A mesh outside this range is scaled until its
longest side is LENGTH [m], because its file probably uses another unit, or the body would look rigid or
limp."""

SECONDS = 5.0
"""Default length of a film [s]. A Stage has its own default length."""

DROP = 0.5
"""Initial distance between a mesh and the floor, as a fraction of the mesh's height."""


def film(
    scene: Annotated[
        str,
        typer.Argument(
            help="A mesh file, a script that makes a World or a Stage, or a function that returns one: "
            "scene.py:make."
        ),
    ],
    out: Out = None,
    seconds: Seconds = None,
    fps: Fps = 50.0,
    size: Size = "1280x720",
    slow: Slow = 1.0,
    blur: Blur = 1,
    stats: Stats = False,
    orbit: Annotated[
        bool, typer.Option("--orbit", help="Let the camera orbit once during the film.")
    ] = False,
    material: Annotated[
        str | None,
        typer.Option(help="For a mesh: material preset, see taichi-soft info; gelatine by default."),
    ] = None,
    length: Annotated[
        float | None,
        typer.Option(help="For a mesh: its longest side in metres; by default that of the file."),
    ] = None,
    cells: Annotated[
        int | None, typer.Option(help="For a mesh: cells along its longest side; 10 by default.")
    ] = None,
    up: Annotated[
        str | None, typer.Option(help="For a mesh: axis that points up in its file, y or z.")
    ] = None,
    arch: Arch = "auto",
    threads: Threads = None,
) -> None:
    """Film a mesh that falls onto the floor, or your own world, without a display."""
    pixels = size_of(size)
    if seconds is not None:
        as_positive(seconds, "seconds", "s")
    place = Path(scene)
    is_mesh = place.suffix.lower() in SURFACES
    options = {"--material": material, "--length": length, "--cells": cells, "--up": up}
    given = [name for name, value in options.items() if value is not None]
    if given and not is_mesh:
        raise OptionError(f"{given[0]} is for mesh files, and {scene} is a scene: set it in the scene")
    init(arch, threads)
    if is_mesh:
        find = _drop_of(place, material or MATERIAL, length, cells, up)
    else:
        find = _scene_of(scene)
    name = place.name.partition(":")[0].removesuffix(".py").removesuffix(place.suffix)

    def make_stage() -> Stage:
        return _stage_of(find, name, scene, pixels, seconds, orbit)

    path = out or Path("out") / f"{name}.mp4"
    make_film(
        name, make_stage, path, size=pixels, seconds=seconds, fps=fps, slow=slow, blur=blur, stats=stats
    )


def _stage_of(
    find: Callable[[], Any],
    title: str,
    scene: str,
    size: tuple[int, int],
    seconds: float | None,
    orbit: bool,
) -> Stage:
    """Return the stage that `find` returns. If `find` returns a world, make a stage that shows its motion."""
    from taichi_soft import World
    from taichi_soft.render.camera import Camera
    from taichi_soft.render.camera_moves import Orbit
    from taichi_soft.render.framing import framed
    from taichi_soft.render.stage import Stage

    found = find()
    if isinstance(found, Stage):
        if orbit:
            if not isinstance(found.camera, Camera):
                raise OptionError(
                    f"--orbit needs a fixed camera, and the camera of {scene} moves: leave out --orbit"
                )
            found.camera = Orbit(found.camera, found.seconds if seconds is None else seconds)
        return found
    if not isinstance(found, World):
        raise OptionError(f"{scene} must return a World or a Stage, got {found!r}")
    length = SECONDS if seconds is None else seconds
    waiting = [found]
    del found

    def make() -> Stage:
        if not waiting:
            gc.collect()  # free the fields of the first world
        world = waiting.pop() if waiting else find()
        if not world.is_built:
            world.build()
        return Stage.of(world, title=title, seconds=length)

    return framed(make, aspect=size[0] / size[1], orbit=length if orbit else None)


def _scene_of(scene: str) -> Callable[[], Any]:
    """Return a function that runs a script or function to make a new world or stage."""
    if ":" not in scene and not scene.endswith(".py"):
        from taichi_soft.render.demos import demo_names

        advice = (
            f"name a mesh file ({', '.join(SURFACES)}), a script (scene.py) or a function (scene.py:make)"
        )
        if scene in demo_names():
            advice = f"it is a demo: taichi-soft demo {scene}"
        raise OptionError(f"cannot film {scene!r}: {advice}")
    if not scene.endswith(".py"):
        return function_of(scene, "what to film")

    def find() -> Any:
        from taichi_soft import World
        from taichi_soft.render.stage import Stage

        made = variables_of(scene)
        for kind in (Stage, World):
            found = {id(each): each for each in made.values() if isinstance(each, kind)}
            if len(found) == 1:
                return next(iter(found.values()))
            if found:
                break
        raise OptionError(f"{scene} must have exactly one global World or Stage, found {len(found)}")

    return find


def _drop_of(
    file: Path, material: str, length: float | None, cells: int | None, up: Any
) -> Callable[[], Any]:
    """Return a function that makes a world in which the mesh from a file falls onto the floor."""
    from taichi_soft import SoftBodyAsset, World

    made_of = preset(material)  # type: ignore[arg-type]
    surfaces = read_surfaces(file, up)
    points, _ = joined(surfaces)
    own = float(np.ptp(points, axis=0).max())
    wanted = own if length is None else as_positive(length, "length", "m")
    if own <= 0.0:
        raise MeshError(f"{file.name}: all vertices are at the same point")
    if length is None and not SMALLEST <= own <= LARGEST:
        wanted = LENGTH
        say(
            f"{escape(file.name)} is {own:.4g} m long in its file and is scaled to {wanted:g} m: "
            "--length sets another length"
        )
    if wanted != own:
        surfaces = tuple(replace(each, vertices=each.vertices * (wanted / own)) for each in surfaces)
    asset = SoftBodyAsset.from_surface(surfaces, made_of, cells=cells)
    low, high = asset.mesh.bounds
    middle = (low + high) / 2.0
    place = (-middle[0], -middle[1], DROP * (high[2] - low[2]) - low[2])

    def find() -> World:
        world = World()
        world.add_body(asset, position=place)
        world.build()
        return world

    return find
