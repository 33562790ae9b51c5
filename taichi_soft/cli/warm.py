"""Command `warm`: compile kernels before a game needs them."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from taichi_soft.cli.console import Arch, Threads, errors, say
from taichi_soft.cli.named_function import function_of
from taichi_soft.core.compilation import BURST, shown_by
from taichi_soft.core.errors import OptionError
from taichi_soft.core.runtime import init, kernel_folder


def warm(
    worlds: Annotated[
        str,
        typer.Argument(help="Function in a file or module that returns built worlds: game.py:make_world."),
    ],
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for the kernels, to ship with a game; by default the shared cache."),
    ] = None,
    arch: Arch = "auto",
    threads: Threads = None,
) -> None:
    """Compile all kernels of a game's worlds, so that its next start loads them from the cache."""
    make = function_of(worlds, "which worlds")
    if out is not None:
        os.environ["TI_OFFLINE_CACHE_FILE_PATH"] = str(out.resolve())
    if threads is not None or arch != "auto":  # otherwise the game can still choose the device
        init(arch, threads)
    start = time.perf_counter()
    with (
        errors.status("building") as status,
        shown_by(lambda text: status.update(escape(text) or "building")),
    ):
        count = 0
        for world in _worlds_of(make(), worlds):
            world.warm_up()
            count += 1
    took = time.perf_counter() - start
    say(
        f"{count} {'world' if count == 1 else 'worlds'} in {took:.1f} s: {BURST.made} kernels compiled, "
        f"{BURST.found} already in the cache"
    )
    say(f"starts that build the same worlds in the same order load them from {escape(str(kernel_folder()))}")
    if out is not None:
        say("set TI_OFFLINE_CACHE_FILE_PATH to that folder")


def _worlds_of(found: Any, text: str) -> Iterable[Any]:
    from taichi_soft import World

    each = list(found) if isinstance(found, Iterable) else [found]
    if not each or not all(isinstance(world, World) for world in each):
        raise OptionError(f"{text} must return a built World, or several, got {found!r}")
    return each
