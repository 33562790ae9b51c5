"""Find the script or the function that a command-line argument names, such as `game.py:make_world`."""

from __future__ import annotations

import importlib
import os
import runpy
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from taichi_soft.core.errors import OptionError


def function_of(text: str, what: str) -> Callable[[], Any]:
    """Return the function that a text such as `game.py:make_world` names.

    Args:
        what: first words of error messages. They name the purpose of the function, such as "which worlds".
    Raises: OptionError for malformed text, a failed import, or an unknown name.
    """
    place, _, name = text.rpartition(":")
    if not place or not name.isidentifier():
        raise OptionError(f"{what}, must be like game.py:make_world, got {text!r}")
    sys.path.insert(0, os.getcwd())
    try:
        function = _names_in(place).get(name)
    except (ImportError, OSError) as error:
        raise OptionError(f"cannot import {place!r}: {error}") from error
    if not callable(function):
        raise OptionError(f"{place!r} has no function {name!r}")
    return function  # type: ignore[no-any-return]


def variables_of(script: str) -> dict[str, Any]:
    """Run a script. The script can import modules from its own folder and from the current folder.

    Returns: the script's variables, by name.
    Raises: OptionError if the file cannot be read; errors of the script.
    """
    try:
        Path(script).read_bytes()
    except OSError as error:
        raise OptionError(f"cannot read {script}: {error.strerror}") from error
    sys.path[:0] = [str(Path(script).parent.resolve()), os.getcwd()]
    return runpy.run_path(script, run_name="taichi_soft_scene")


def _names_in(place: str) -> dict[str, Any]:
    if not place.endswith(".py"):
        return vars(importlib.import_module(place))
    sys.path.insert(0, str(Path(place).parent.resolve()))
    return runpy.run_path(place)
