"""Measure in separate Python processes, because a process cannot change the device and threads of Taichi."""

from __future__ import annotations

import subprocess
import sys

from taichi_soft.core.errors import DeviceError
from taichi_soft.profiling.spread import Spread

WARM_TURNS = 2


class Process:
    """A child process that reads lines and answers each line with a time [s]."""

    def __init__(self, program: str, name: str, advice: str) -> None:
        """Start the process.

        Args:
            program: source code that reads lines and prints a time [s] for each.
            name: name of the process for error messages.
            advice: advice for error messages.
        """
        self._failure = f"{name} failed: {advice}"
        self._process = subprocess.Popen(
            [sys.executable, "-c", program],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def __enter__(self) -> Process:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.communicate()

    def ask(self, line: str) -> float:
        """Send a line and return the time that the process answers [s]. Raises: DeviceError if the process
        has failed.
        """
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(f"{line}\n")
            self._process.stdin.flush()
            return float(self._process.stdout.readline())
        except (OSError, ValueError):
            raise DeviceError(self._failure) from None


def compare_processes(one: Process, other: Process, line: str, repeats: int) -> tuple[Spread, Spread, Spread]:
    """Ask two processes alternately, after a warm-up. A slowdown of the machine then affects both processes.

    Returns: times of `one` [ms], times of `other` [ms], and `one` divided by `other` for each pair.
    """
    pairs = [(one.ask(line), other.ask(line)) for _ in range(WARM_TURNS + repeats)][WARM_TURNS:]
    ones, others = ([pair[i] for pair in pairs] for i in (0, 1))
    return Spread.of(ones).scaled(1e3), Spread.of(others).scaled(1e3), Spread.of([a / b for a, b in pairs])
