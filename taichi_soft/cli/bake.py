"""Command `bake`: write a simulation to a file for a content pipeline."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from taichi_soft.cli.console import Arch, Threads, progress_bar, say
from taichi_soft.cli.named_function import function_of
from taichi_soft.core.compilation import shown_by
from taichi_soft.core.errors import OptionError
from taichi_soft.core.runtime import init


def bake(
    scene: Annotated[
        str,
        typer.Argument(help="Function in a file or module that returns a world: scene.py:make_world."),
    ],
    out: Annotated[
        Path,
        typer.Option(help="Output: .glb, .npz, .vat (a folder with textures and shaders) or .usdc."),
    ],
    seconds: Annotated[float, typer.Option(help="Length of the clip [s].")],
    fps: Annotated[float, typer.Option(help="Frames per second.")] = 30.0,
    step: Annotated[
        bool,
        typer.Option("--step", help="Hold each frame of a .glb until the next one, without interpolation."),
    ] = False,
    limit: Annotated[float, typer.Option(help="Largest size of the file [MB].")] = 1000.0,
    arch: Arch = "auto",
    threads: Threads = None,
) -> None:
    """Simulate a scene and write its meshes and motion for Blender, a game engine or a web page."""
    make = function_of(scene, "which scene")
    if threads is not None or arch != "auto":  # otherwise the scene can still choose the device
        init(arch, threads)
    made = _scene_of(make(), scene)
    from taichi_soft.bake import bake as write

    with (
        progress_bar() as progress,
        shown_by(lambda text: progress.update(task, description=escape(text) or "baking")),
    ):
        task = progress.add_task("baking", total=None)
        report = write(
            made,
            out,
            seconds=seconds,
            fps=fps,
            interpolation="step" if step else "linear",
            limit=limit,
            on_room=lambda room: say(str(room)),
            on_frame=lambda done, total: progress.update(
                task, description="baking" if done < total else "writing", completed=done, total=total
            ),
        )
    for name in report.left_out:
        say(f"{name} has no triangles and was skipped")
    say(
        f"wrote {escape(str(report.path))}: {report.frames} frames at {report.fps:g} per second, "
        f"{len(report.meshes)} {'mesh' if len(report.meshes) == 1 else 'meshes'}, {report.size / 1e6:.1f} MB"
    )


def _scene_of(found: Any, text: str) -> Any:
    from engine_adapter import EngineAdapter
    from taichi_soft import World

    if not isinstance(found, (World, EngineAdapter)):
        raise OptionError(f"{text} must return a World or an EngineAdapter, got {found!r}")
    return found
