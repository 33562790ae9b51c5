"""The command line: demos and films, what was chosen on this machine, what a frame costs."""

from __future__ import annotations

import sys

from taichi_soft.core.errors import MissingExtraError
from taichi_soft.core.extras import require_extra


def main(*arguments: str) -> None:
    """Run the command line; an error of ours is one line and exit code 1, a wrong option 2.

    Args:
        arguments: to run with; without any, those of the process.
    """
    try:
        require_extra("cli", "the command line needs")
    except MissingExtraError as error:
        sys.exit(f"error: {error}")
    from taichi_soft.cli.app import run

    run(*arguments)
