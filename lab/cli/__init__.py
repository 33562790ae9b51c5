"""`python -m lab`: the thesis's experiments, the drop test, and other engines."""

from __future__ import annotations

import sys

from taichi_soft.core.errors import MissingExtraError
from taichi_soft.core.extras import require_extra


def main(*arguments: str) -> None:
    """Run the command line. Errors of this package end it by one line and exit code 1, wrong options by 2.

    Args:
        arguments: of the command; without any, those of the process.
    """
    try:
        require_extra("cli", "the command line needs")
    except MissingExtraError as error:
        sys.exit(f"error: {error}")
    from lab.cli.app import app
    from taichi_soft.cli.running import run_app

    run_app(app, *arguments)
