"""Command line for demos, films, bakes, exports, profiles and device information."""

from __future__ import annotations

import sys

from taichi_soft.core.errors import MissingExtraError
from taichi_soft.core.extras import require_extra


def main(*arguments: str) -> None:
    """Run the command line.

    A TaichiSoftError is printed as one line, and the exit code is 1. For a wrong option, the exit code is 2.

    Args:
        arguments: command-line arguments; by default those of the process.
    """
    try:
        require_extra("cli", "the command line needs")
    except MissingExtraError as error:
        sys.exit(f"error: {error}")
    from taichi_soft.cli.app import run

    run(*arguments)
