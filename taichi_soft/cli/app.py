"""The commands, and what becomes of errors and signals."""

from __future__ import annotations

import sys
import warnings
from typing import Annotated, Any

import typer
from rich.markup import escape

from taichi_soft.cli.bake import bake
from taichi_soft.cli.console import errors, say, version_of
from taichi_soft.cli.demo import demo
from taichi_soft.cli.doctor import doctor
from taichi_soft.cli.drop_test import drop_test
from taichi_soft.cli.export import export
from taichi_soft.cli.film import film
from taichi_soft.cli.info import info
from taichi_soft.cli.live import live
from taichi_soft.cli.profile import profile
from taichi_soft.cli.replay import replay
from taichi_soft.cli.report import report
from taichi_soft.cli.warm import warm
from taichi_soft.core.errors import TaichiSoftError
from taichi_soft.core.signals import INTERRUPTED, ended_by_signals

app = typer.Typer(
    help="Real-time soft bodies from real material parameters.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,  # it would take units in brackets, such as [s], for markup
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for _command in (demo, film, live, info, doctor, bake, export, replay, profile, drop_test, report, warm):
    summary = (_command.__doc__ or "").split("\n\n")[0]
    app.command(short_help=" ".join(summary.split()))(_command)


def run(*arguments: str) -> None:
    """As `cli.main`, with the extra `cli` installed."""
    warnings.showwarning = _show_warning  # type: ignore[assignment]
    try:
        with ended_by_signals():
            app(arguments or None)
    except TaichiSoftError as error:
        errors.print(f"[bold red]error:[/] {escape(str(error))}", soft_wrap=True, highlight=False)
        sys.exit(1)
    except (KeyboardInterrupt, SystemExit) as end:
        if isinstance(end, SystemExit) and end.code != INTERRUPTED:
            raise
        errors.print("interrupted")
        sys.exit(INTERRUPTED)


def _show_version(asked: bool) -> None:
    if asked:
        say(f"taichi-soft {version_of('taichi-soft')}")
        raise typer.Exit


def _show_warning(message: Warning | str, category: type[Warning], *_: Any) -> None:
    errors.print(f"[yellow]{category.__name__}:[/] {escape(str(message))}", soft_wrap=True, highlight=False)


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_show_version, help="Print the version.")
    ] = False,
) -> None:
    pass
