"""What is to be computed, and what came of it."""

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
        function: from the point to what was measured, both plain data. Other processes find it by its name.
        is_alone: nothing else may run meanwhile.
    """

    group: str
    function: Callable[[dict[str, Any]], dict[str, Any]]
    point: dict[str, Any]
    is_alone: bool = False


@dataclass(frozen=True)
class Outcome:
    """What came of a point: numbers, or None and the reason."""

    numbers: dict[str, Any] | None
    error: str = ""
    seconds: float = 0.0


def compute(
    arch: ArchName, function: Callable[[dict[str, Any]], dict[str, Any]], point: dict[str, Any]
) -> Outcome:
    """Compute a point in this process, on one thread of the CPU or on `arch`.

    What was measured goes through JSON: it is the same whether it comes from a process or from a file.
    Warnings are not shown: experiments leave on purpose what games are warned about.
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
    """What went wrong and where, in one line."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    file = place.filename.replace("\\", "/").rpartition("/")[2]
    return f"{type(error).__name__}: {' '.join(str(error).split())} ({file}:{place.lineno})"
