"""A world live in the browser."""

from __future__ import annotations

import asyncio
import signal
import webbrowser
from contextlib import suppress
from typing import Annotated

import typer
from rich.markup import escape

from taichi_soft.cli.console import say
from taichi_soft.core.errors import OptionError
from taichi_soft.core.extras import require_extra


def live(
    scene: Annotated[
        str | None,
        typer.Argument(help="A demo, a mesh, or a script that makes a World; without it, some bodies."),
    ] = None,
    host: Annotated[
        str, typer.Option(help="Address to serve at; any but this machine's own asks for a token.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="0 takes a free one.")] = 8080,
    browser: Annotated[bool, typer.Option(help="Open the page.")] = True,
) -> None:
    """Show a world in the browser, to be seen, touched and tuned, until Ctrl-C."""
    require_extra("live", "a live world needs")
    from taichi_soft.live.scene import found_source
    from taichi_soft.live.server import LiveServer

    server = LiveServer(found_source(scene), host=host, port=port)
    with suppress(KeyboardInterrupt):
        asyncio.run(_serve(server, browser))


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
    say(f"open {escape(address)} in a browser; Ctrl-C ends it")
    if opens:
        webbrowser.open(address)
    try:
        await ended.wait()
    finally:
        await server.close()
