"""Demos, filmed without a display."""

from __future__ import annotations

from pathlib import Path
from statistics import median
from typing import Annotated, Any

import typer
from rich.markup import escape

from taichi_soft.cli.console import Arch, Threads, progress_bar, say
from taichi_soft.core.compilation import shown_by
from taichi_soft.core.errors import OptionError
from taichi_soft.core.runtime import init


def demo(
    name: Annotated[str | None, typer.Argument(help="Which demo; without a name, lists them.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Film to write: .mp4, .webm, .gif, or .png for pictures.")
    ] = None,
    seconds: Annotated[float | None, typer.Option(help="Length of the film [s].")] = None,
    fps: Annotated[float, typer.Option(help="Frames per second.")] = 50.0,
    size: Annotated[str, typer.Option(help="Width x height in pixels.")] = "1280x720",
    slow: Annotated[float, typer.Option(help="How many times slower than the world the film is.")] = 1.0,
    blur: Annotated[int, typer.Option(help="Pictures averaged to one, for motion blur; 1 is sharp.")] = 1,
    framed: Annotated[bool, typer.Option(help="Look from where all places of the bodies are seen.")] = False,
    orbit: Annotated[
        float | None, typer.Option(help="The camera goes round once in so much time of the world [s].")
    ] = None,
    stats: Annotated[
        bool, typer.Option("--stats", help="Write time and speed of this machine on each frame.")
    ] = False,
    video: Annotated[bool, typer.Option(help="Write a film, or only run and time the steps.")] = True,
    peers: Annotated[
        bool, typer.Option("--peers", help="compare: one drop here and in other engines.")
    ] = False,
    arch: Arch = "auto",
    threads: Threads = None,
) -> None:
    """Run a demo without a display, film it, and say how fast it ran, as a multiple of real time."""
    from taichi_soft.render.demos import demo_names, load_demo

    if peers and name != "compare":
        raise OptionError("--peers belongs to the demo compare: taichi-soft demo compare --peers")
    if name is None:
        for each in demo_names():
            summary = (load_demo(each).__doc__ or "").strip().splitlines()[0]
            say(f"[bold]{each:12}[/]{escape(summary)}")
        return
    pixels = _size_of(size)
    if peers:
        from taichi_soft.cli.peers import film_peers

        film_peers((out or Path("out") / "peers.mp4") if video else None, seconds, fps, pixels, arch, threads)
        return
    module = load_demo(name)
    path = (out or Path("out") / f"{name}.mp4") if video else None
    init(arch, threads)
    from taichi_soft.render.camera_moves import Orbit
    from taichi_soft.render.film import film
    from taichi_soft.render.framing import framed as framed_stage

    bar = progress_bar()
    task = bar.add_task(name, total=None)
    with bar as progress, shown_by(lambda text: progress.update(task, description=escape(text) or name)):
        width, height = pixels
        stage: Any = (
            framed_stage(module.stage, aspect=width / height, seconds=seconds) if framed else module.stage()
        )
        if orbit is not None:
            stage.camera = Orbit(stage.camera, orbit)
        report = film(
            stage,
            path,
            fps=fps,
            size=pixels,
            seconds=seconds,
            slow=slow,
            blur=blur,
            stats=stats,
            on_frame=lambda done, total: progress.update(task, description=name, completed=done, total=total),
        )
    if report.path is not None:
        say(f"wrote {escape(str(report.path))}: {report.frames} frames, {report.frames / fps:.1f} s")
    if len(report.step_times):
        frame = f"median {median(report.step_times) * 1e3:.2f} ms per frame of {1e3 / fps:.1f} ms"
        say(f"{name}: {report.simulated:.2f} s simulated, {frame}: {report.real_time_factor:.1f} x real time")
    if len(report.draw_times):
        say(f"a picture of {size} took {median(report.draw_times) * 1e3:.1f} ms to draw, at the median")


def _size_of(text: str) -> tuple[int, int]:
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise OptionError(f"size must be width x height in pixels, such as 1280x720, got {text!r}")
    return int(width), int(height)
