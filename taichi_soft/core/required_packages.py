"""Packages that only some of the calls need, and the extra that brings them."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec

from taichi_soft.core.errors import OptionError


def require_packages(purpose: str, extra: str, packages: Mapping[str, str]) -> None:
    """Say which packages are missing and how to get them.

    Args:
        purpose: what needs them, as the subject of a sentence in the singular: "a report".
        extra: of this package, in which they are.
        packages: names of modules, and of the packages that have them.
    Raises: OptionError where one is missing.
    """
    missing = [package for module, package in packages.items() if not _is_there(module)]
    if missing:
        raise OptionError(
            f"{purpose} needs {', '.join(missing)}, not installed here: "
            f"run pip install 'taichi-soft[{extra}]'"
        )


def _is_there(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except ImportError:
        return False
