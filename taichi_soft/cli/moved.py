"""Commands of earlier versions that now need a source checkout."""

from __future__ import annotations

import typer

from taichi_soft.core.errors import OptionError

MOVED = ("drop-test", "report")
"""Commands that moved to `python -m lab` and kept their names."""


def add_moved(app: typer.Typer) -> None:
    """Add hidden commands that accept any arguments and fail with the name of the new command."""
    anything = {"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []}
    for name in MOVED:
        app.command(name, hidden=True, context_settings=anything)(_refuse)


def _refuse(context: typer.Context) -> None:
    refuse_moved(f"taichi-soft {context.info_name}", str(context.info_name))


def refuse_moved(old: str, new: str) -> None:
    """Raise an OptionError that names the new command and says that it needs a source checkout."""
    raise OptionError(f"{old} needs a checkout of the sources: run python -m lab {new} there")
