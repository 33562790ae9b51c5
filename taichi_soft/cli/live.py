"""Command `live`: show a live world in the browser."""

from __future__ import annotations

import asyncio
import signal
import webbrowser
from collections.abc import Iterable
from contextlib import suppress
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from taichi_soft.cli.console import console, errors, progress_bar, say
from taichi_soft.core.errors import OptionError
from taichi_soft.core.extras import require_extra


def live(
    scene: Annotated[
        str | None,
        typer.Argument(help="A demo, a mesh, or a script that makes a World; by default a playground."),
    ] = None,
    host: Annotated[
        str, typer.Option(help="Address to serve at; any address except loopback requires a token.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0 takes a free one.")] = 8080,
    browser: Annotated[bool, typer.Option(help="Open the page.")] = True,
    measure: Annotated[
        bool,
        typer.Option("--measure", help="Measure latency and the cost of a visitor instead (8 minutes)."),
    ] = False,
) -> None:
    """Show a world in the browser until Ctrl-C. Visitors can grab bodies and change parameters."""
    require_extra("live", "a live world needs")
    from taichi_soft.live.scene import found_source
    from taichi_soft.live.server import LiveServer

    if measure:
        _measure()
        return
    server = LiveServer(found_source(scene), host=host, port=port)
    with suppress(KeyboardInterrupt):
        asyncio.run(_serve(server, browser))


def _measure() -> None:
    from taichi_soft.live.measuring import measure

    with progress_bar() as progress:
        task = progress.add_task("compiling", total=None)
        costs = measure(lambda words: progress.update(task, description=words))
    table = Table("spheres", *(str(each.spheres) for each in costs), title="a live view, for one visitor")
    table.add_row("triangles", *(f"{each.triangles:,}" for each in costs))
    table.add_row("bytes a frame", *(f"{each.packet:,}" for each in costs))
    table.add_row("FPS", *(f"{each.pictures:.0f}" for each in costs))
    table.add_row("latency p50, p95 (ms)", *(_numbers(each.latency_ms, 1) for each in costs))
    table.add_row("step p50, p99 (ms), no visitor", *(_numbers(each.alone_ms, 1) for each in costs))
    table.add_row("step p50, p99 (ms), one visitor", *(_numbers(each.visited_ms, 1) for each in costs))
    middle = [(each.ratios[0], each.ratios[len(each.ratios) // 2], each.ratios[-1]) for each in costs]
    table.add_row("ratio of p99: least, median, most", *(_numbers(three, 2) for three in middle))
    console.print(table)
    say("latency: from a move of the hand to the first frame that shows it, at the socket, without rendering")
    say("step: median over turns without and with a visitor; ratio: of the p99 within a turn")


def _numbers(numbers: Iterable[float], digits: int) -> str:
    return ", ".join(f"{number:.{digits}f}" for number in numbers)


async def _serve(server: object, opens: bool) -> None:
    from taichi_soft.live.server import LiveServer

    assert isinstance(server, LiveServer)
    ended = asyncio.Event()
    for each in (signal.SIGINT, signal.SIGTERM):
        with suppress(NotImplementedError):
            asyncio.get_running_loop().add_signal_handler(each, ended.set)
    try:
        address = await server.open()
    except OSError as error:
        place = f"{server.host}:{server.port}"
        raise OptionError(f"cannot serve at {place}: {error.strerror or error}") from error
    say(f"open {escape(address)} in a browser; press Ctrl-C to stop")
    if opens:
        webbrowser.open(address)
    try:
        told = None
        while not ended.is_set():
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(ended.wait(), 1.0)
            if server.audience.trouble not in (None, told):
                told = server.audience.trouble
                errors.print(f"[bold red]error:[/] {escape(told)}", soft_wrap=True, highlight=False)
    finally:
        await server.close()
