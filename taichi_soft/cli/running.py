"""Make a command line from functions, run it, and handle errors, warnings and signals."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from typing import Any

import typer
from rich.markup import escape

from taichi_soft.cli.console import errors
from taichi_soft.core.errors import TaichiSoftError
from taichi_soft.core.signals import INTERRUPTED, ended_by_signals


def make_app(summary: str, *commands: Callable[..., None]) -> typer.Typer:
    """Make a command line with a command for each function.

    Args:
        summary: help text of the command line.
        commands: functions. The first paragraph of a docstring is the summary of its command.
    """
    app = typer.Typer(
        help=summary,
        no_args_is_help=True,
        add_completion=False,
        rich_markup_mode=None,  # units in brackets, such as [s], are not markup
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    for command in commands:
        first = (command.__doc__ or "").split("\n\n")[0]
        app.command(short_help=" ".join(first.split()))(command)
    return app


def run_app(app: typer.Typer, *arguments: str) -> None:
    """Run a command line.

    A TaichiSoftError is printed as one line, and the exit code is 1. For a wrong option, the exit code is 2.

    Args:
        app: result of `make_app`.
        arguments: command-line arguments; by default those of the process.
    """
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


def _show_warning(message: Warning | str, category: type[Warning], *_: Any) -> None:
    errors.print(f"[yellow]{category.__name__}:[/] {escape(str(message))}", soft_wrap=True, highlight=False)
