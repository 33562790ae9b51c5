"""Command `demo`: film a demo without a display."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from taichi_soft.cli.console import Arch, Threads, say
from taichi_soft.cli.filming import Blur, Fps, Out, Seconds, Size, Slow, Stats, make_film, size_of
from taichi_soft.cli.moved import refuse_moved
from taichi_soft.core.runtime import init


def demo(
    name: Annotated[
        str | None, typer.Argument(help="Name of the demo; without a name, list all demos.")
    ] = None,
    out: Out = None,
    seconds: Seconds = None,
    fps: Fps = 50.0,
    size: Size = "1280x720",
    slow: Slow = 1.0,
    blur: Blur = 1,
    framed: Annotated[
        bool, typer.Option(help="Move the camera until it sees the bodies at all times.")
    ] = False,
    orbit: Annotated[
        float | None, typer.Option(help="Period of an orbiting camera [s of world time].")
    ] = None,
    stats: Stats = False,
    video: Annotated[
        bool, typer.Option(help="Write a film; without it, only run and time the steps.")
    ] = True,
    peers: Annotated[bool, typer.Option("--peers", hidden=True)] = False,
    arch: Arch = "auto",
    threads: Threads = None,
) -> None:
    """Run and film a demo without a display, and print its speed as a multiple of real time."""
    from taichi_soft.render.demos import demo_names, load_demo

    if peers:
        refuse_moved("taichi-soft demo --peers", "peers")
    if name is None:
        for each in demo_names():
            summary = (load_demo(each).__doc__ or "").strip().splitlines()[0]
            say(f"[bold]{each:12}[/]{escape(summary)}")
        return
    pixels = size_of(size)
    module = load_demo(name)
    path = (out or Path("out") / f"{name}.mp4") if video else None
    init(arch, threads)
    from taichi_soft.render.camera_moves import Orbit
    from taichi_soft.render.framing import framed as framed_stage

    def make_stage() -> Any:
        if framed:
            width, height = pixels
            return framed_stage(module.stage, aspect=width / height, seconds=seconds, orbit=orbit)
        stage = module.stage()
        if orbit is not None:
            stage.camera = Orbit(stage.camera, orbit)
        return stage

    make_film(
        name, make_stage, path, size=pixels, seconds=seconds, fps=fps, slow=slow, blur=blur, stats=stats
    )
