"""Command line `python -m lab`: the thesis's experiments, the drop test, and other engines."""

from __future__ import annotations

import sys

from taichi_soft.core.errors import MissingExtraError
from taichi_soft.core.extras import require_extra


def main(*arguments: str) -> None:
    """Run the command line.

    For an error of this package, print one line and exit with code 1. For invalid options, exit with code 2.
    Args:
        arguments: command-line arguments; by default the arguments of the process.
    """
    try:
        require_extra("cli", "the command line needs")
    except MissingExtraError as error:
        sys.exit(f"error: {error}")
    from lab.cli.app import app
    from taichi_soft.cli.running import run_app

    run_app(app, *arguments)
