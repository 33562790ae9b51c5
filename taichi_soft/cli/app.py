"""The commands of `taichi-soft`."""

from __future__ import annotations

from typing import Annotated

import typer

from taichi_soft.cli.bake import bake
from taichi_soft.cli.console import say, version_of
from taichi_soft.cli.demo import demo
from taichi_soft.cli.doctor import doctor
from taichi_soft.cli.export import export
from taichi_soft.cli.film import film
from taichi_soft.cli.info import info
from taichi_soft.cli.live import live
from taichi_soft.cli.moved import add_moved
from taichi_soft.cli.profile import profile
from taichi_soft.cli.replay import replay
from taichi_soft.cli.running import make_app, run_app
from taichi_soft.cli.warm import warm

app = make_app(
    "Real-time soft bodies from real material parameters.",
    *(demo, film, live, info, doctor, bake, export, replay, profile, warm),
)
add_moved(app)


def run(*arguments: str) -> None:
    """Run the command line, see `cli.main`. The command line requires the extra `cli`."""
    run_app(app, *arguments)


def _show_version(asked: bool) -> None:
    if asked:
        say(f"taichi-soft {version_of('taichi-soft')}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_show_version, help="Print the version.")
    ] = False,
) -> None:
    pass
