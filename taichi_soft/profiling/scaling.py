"""How much faster many bodies run on several threads. Taichi's thread count is fixed per process."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass

from taichi_soft.errors import DeviceError

BODIES = 64
ROUNDS = 3


@dataclass(frozen=True)
class Scaling:
    """Median frame of 64 spheres, physics and reading [ms]."""

    threads: int
    frame: float
    speedup: float  # over one thread


def measure_scaling(threads: int, repeats: int) -> list[Scaling]:
    """Measure one thread and `threads`, in turns, in processes of their own; the best of each counts.

    Raises: DeviceError if such a process fails.
    """
    counts = sorted({1, threads})
    best = dict.fromkeys(counts, float("inf"))
    for _ in range(ROUNDS):
        for count in counts:
            best[count] = min(best[count], _median_frame(count, repeats))
    return [Scaling(count, best[count], best[1] / best[count]) for count in counts]


def _median_frame(threads: int, repeats: int) -> float:
    command = [sys.executable, "-m", "taichi_soft", "profile", "--json", "--arch", "cpu"]
    command += ["--bodies", str(BODIES), "--threads", str(threads), "--repeats", str(repeats)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise DeviceError(f"a profile of {threads} threads failed: {done.stderr.strip()}")
    return float(json.loads(done.stdout)["budget"][0]["measured"]["frame"]["median"])
