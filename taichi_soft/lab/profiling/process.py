"""A Python process of its own, asked line by line: Taichi's device and threads are fixed per process."""

from __future__ import annotations

import subprocess
import sys

from taichi_soft.core.errors import DeviceError


class Process:
    """Answers each line with a number."""

    def __init__(self, program: str, name: str, advice: str) -> None:
        """Start it.

        Args:
            program: its source, which reads lines and prints a number for each.
            name: what a message calls it.
            advice: what to try where it fails.
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
        """Its answer. Raises: DeviceError if the process has failed."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(f"{line}\n")
            self._process.stdin.flush()
            return float(self._process.stdout.readline())
        except (OSError, ValueError):
            raise DeviceError(self._failure) from None
