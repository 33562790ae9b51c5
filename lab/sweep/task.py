"""Tasks, and the outcomes of computing them."""

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
        group: name of the point's group. Points of a group share compiled kernels, so one process should
            compute them.
        function: function that computes the point and returns plain data. Other processes import it by name.
        is_alone: True if nothing else may run at the same time.
    """

    group: str
    function: Callable[[dict[str, Any]], dict[str, Any]]
    point: dict[str, Any]
    is_alone: bool = False


@dataclass(frozen=True)
class Outcome:
    """Outcome of a point: its numbers, or None and an error."""

    numbers: dict[str, Any] | None
    error: str = ""
    seconds: float = 0.0


def compute(
    arch: ArchName, function: Callable[[dict[str, Any]], dict[str, Any]], point: dict[str, Any]
) -> Outcome:
    """Compute a point in this process, on the device `arch`. A CPU uses one thread.

    Results are converted to JSON and back, so that results from a process and from a file are equal. Warnings
    are ignored, because experiments deliberately use settings that cause warnings.
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
    """Format an error and its place in one line."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    file = place.filename.replace("\\", "/").rpartition("/")[2]
    return f"{type(error).__name__}: {' '.join(str(error).split())} ({file}:{place.lineno})"
