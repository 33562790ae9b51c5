"""Command `export`: write a world as a folder for engines without Python."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from taichi_soft.cli.console import progress_bar, say
from taichi_soft.cli.named_function import function_of, variables_of
from taichi_soft.core.errors import OptionError
from taichi_soft.core.runtime import init


def export(
    scene: Annotated[
        str,
        typer.Argument(help="Script that makes a World, or a function that returns one: game.py:make."),
    ],
    out: Annotated[Path, typer.Option(help="Folder to write: game.softworld.")],
    axes: Annotated[
        str, typer.Option(help="Axes of the engine: z-up, y-up (Godot), unity, unreal.")
    ] = "z-up",
    for_: Annotated[
        str | None,
        typer.Option(
            "--for",
            help="Platforms: linux-x64, windows-x64, linux-arm64, macos-arm64, web, separated by commas, "
            "or all. This machine's by default.",
        ),
    ] = None,
    static: Annotated[
        bool,
        typer.Option(
            "--static", help="Write objects to link into the game, for systems that forbid loading code."
        ),
    ] = False,
) -> None:
    """Write a world and its kernels for the C library, which steps the world in an engine without Python.

    Scripts need no changes. The command exports the state that the world has when the script ends. If the
    script does not build the world, the command does. Bodies, assets, colliders, frames, joints and motors
    are named after the script's variables.
    """
    init("cpu")
    world, names = _found_in(scene)
    from taichi_soft.export import PLATFORMS, export_world

    platforms = None if for_ is None else for_.split(",")
    if for_ == "all":
        platforms = [each for each in PLATFORMS if not (static and each == "web")]
    with progress_bar() as progress:
        task = progress.add_task("compiling", total=None)
        if not world.is_built:
            world.build()
        report = export_world(world, out, axes=axes, names=names, platforms=platforms, static=static)
        progress.update(task, description="done")
    counts = ", ".join(f"{len(each)} {kind}{'' if len(each) == 1 else 's'}" for kind, each in _plural(report))
    say(
        f"wrote {escape(str(report.path))}: {escape(counts)}; {report.kernels} kernels, "
        f"{report.size / 1e6:.1f} MB"
    )


def _plural(report: Any) -> list[tuple[str, list[str]]]:
    words = {"body": "slot", "mesh": "draw list"}
    return [(words.get(kind, kind), each) for kind, each in report.names.items()]


def _found_in(scene: str) -> tuple[Any, dict[Any, str]]:
    """Return the world that a script or function makes, and the names of its parts."""
    from engine_adapter import EngineAdapter
    from taichi_soft import World

    if scene.endswith(".py"):
        made = variables_of(scene)
        worlds = {id(each): each for each in made.values() if isinstance(each, World)}
        if len(worlds) != 1:
            raise OptionError(f"{scene} must have exactly one global World, found {len(worlds)}")
        return next(iter(worlds.values())), _names_in(made)
    found = function_of(scene, "which scene")()
    world = found.world if isinstance(found, EngineAdapter) else found
    if not isinstance(world, World):
        raise OptionError(f"{scene} must return a World or an EngineAdapter, got {found!r}")
    return world, {}


def _names_in(made: Mapping[str, Any]) -> dict[Any, str]:
    """Name each part of a world after the variable that contains it. Add an index for a part in a list."""
    from taichi_soft import Body, Collider, Frame, Joint, Motor, SoftBodyAsset

    found: dict[Any, str] = {}
    for name, value in made.items():
        if name.startswith("__"):
            continue
        several = list(enumerate(value)) if isinstance(value, (list, tuple)) else []
        several = list(value.items()) if isinstance(value, dict) else several
        for text, each in [(name, value), *((f"{name}[{key}]", each) for key, each in several)]:
            if isinstance(each, (Body, Collider, Frame, Joint, Motor, SoftBodyAsset)):
                found.setdefault(each, text)
    return found
