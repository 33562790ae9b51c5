"""How much faster many bodies run on several threads. Taichi's thread count is fixed per process."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass

from taichi_soft.errors import DeviceError

BODIES = 64
SUBSTEPS = (4, 14)
"""Of a step: what this body needs at 60 Hz, and the thesis's 700 per second at 50 Hz."""

ROUNDS = 3

_PROGRAM = """
from functools import partial
from taichi_soft import init
init("cpu", {threads})
from taichi_soft.profiling.phases import spheres
from taichi_soft.profiling.spread import Spread, time_calls
step = partial(spheres({bodies}).step, 1e-3)
for substeps in {substeps}:
    time_calls(partial(step, substeps), 5)
    print(Spread.of(time_calls(partial(step, substeps), {repeats})).median)
"""


@dataclass(frozen=True)
class Scaling:
    """Median step of 64 spheres [ms]."""

    substeps: int
    threads: int
    step: float
    speedup: float  # over one thread


def measure_scaling(threads: int, repeats: int) -> list[Scaling]:
    """Measure one thread and `threads`, in turns, in processes of their own; the best of each counts.

    Raises: DeviceError if such a process fails.
    """
    counts = sorted({1, threads})
    runs = [(count, _median_steps(count, repeats)) for _ in range(ROUNDS) for count in counts]
    best = {
        count: [min(x) for x in zip(*[r for c, r in runs if c == count], strict=True)] for count in counts
    }
    return [
        Scaling(substeps, count, best[count][i] * 1e3, best[1][i] / best[count][i])
        for i, substeps in enumerate(SUBSTEPS)
        for count in counts
    ]


def _median_steps(threads: int, repeats: int) -> list[float]:
    program = _PROGRAM.format(threads=threads, bodies=BODIES, substeps=SUBSTEPS, repeats=repeats)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        said = done.stderr.strip().splitlines() or ["no message"]
        raise DeviceError(f"a process of {threads} threads failed: {said[-1]}")
    return [float(line) for line in done.stdout.split()]
