"""Commands of earlier versions that only a checkout has now."""

from __future__ import annotations

import typer

from taichi_soft.core.errors import OptionError

MOVED = ("drop-test", "report")
"""Commands of `python -m lab`, by their names here and there."""


def add_moved(app: typer.Typer) -> None:
    """Add hidden commands that take anything, and say where the command is."""
    anything = {"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []}
    for name in MOVED:
        app.command(name, hidden=True, context_settings=anything)(_refuse)


def _refuse(context: typer.Context) -> None:
    refuse_moved(f"taichi-soft {context.info_name}", str(context.info_name))


def refuse_moved(old: str, new: str) -> None:
    """Raises: OptionError in one line that names the command of a checkout."""
    raise OptionError(f"{old} is in a checkout of the sources only: run python -m lab {new} there")
