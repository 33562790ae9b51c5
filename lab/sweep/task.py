"""Tasks and their outcomes."""

from __future__ import annotations

import json
import time
import traceback
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from taichi_soft.core.runtime import init
from taichi_soft.core.types import ArchName


@dataclass(frozen=True)
class Task:
    """A point to compute.

    Args:
        group: points of the same group share compiled kernels, and are best computed in the same process.
        function: function of the point that returns plain data. Other processes import it by its name.
        is_alone: True if nothing else may run at the same time.
    """

    group: str
    function: Callable[[dict[str, Any]], dict[str, Any]]
    point: dict[str, Any]
    is_alone: bool = False


@dataclass(frozen=True)
class Outcome:
    """Outcome of a point: numbers, or None and an error."""

    numbers: dict[str, Any] | None
    error: str = ""
    seconds: float = 0.0


def compute(
    arch: ArchName, function: Callable[[dict[str, Any]], dict[str, Any]], point: dict[str, Any]
) -> Outcome:
    """Compute a point in this process, on one thread of the CPU or on `arch`.

    Results are converted to JSON and back, so that they are the same from a process and from a file.
    Warnings are not shown: experiments deliberately do what games are warned about.
    """
    start = time.perf_counter()
    try:
        init(arch, threads=1)
        start = time.perf_counter()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            numbers = json.loads(json.dumps(function(point)))
        if not isinstance(numbers, dict):
            raise TypeError(f"measured {type(numbers).__name__}, wanted a dict of numbers")
    except Exception as error:
        return Outcome(None, _line_of(error), time.perf_counter() - start)
    return Outcome(numbers, seconds=time.perf_counter() - start)


def _line_of(error: Exception) -> str:
    """The error and its place, in one line."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    file = place.filename.replace("\\", "/").rpartition("/")[2]
    return f"{type(error).__name__}: {' '.join(str(error).split())} ({file}:{place.lineno})"
