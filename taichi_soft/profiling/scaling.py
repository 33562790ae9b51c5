"""Measure how much faster several threads step many bodies than one thread.

Each number of threads is measured in its own process.
"""

from __future__ import annotations

from dataclasses import dataclass

from taichi_soft.profiling.process import Process, compare_processes
from taichi_soft.profiling.spread import Spread

BODIES = 64
SUBSTEPS = (4, 14)
"""Measured numbers of substeps per step. The spheres need 4 substeps at 60 Hz. The thesis makes 14 substeps
at 50 Hz, which are 700 substeps per second."""

STEPS_PER_TURN = 5

_PROGRAM = """
import sys
from functools import partial
from taichi_soft import init
init("cpu", {threads}, {cores})
from taichi_soft.profiling.phases import spheres
from taichi_soft.profiling.spread import Spread, time_calls
step = partial(spheres({bodies}).step, 1e-3)
for line in sys.stdin:
    print(Spread.of(time_calls(partial(step, int(line)), {steps})).median, flush=True)
"""


@dataclass(frozen=True)
class Scaling:
    """Time of a step of 64 spheres, on one thread and on several threads [ms]."""

    substeps: int
    threads: int
    single: Spread
    parallel: Spread
    speedup: Spread  # time on one thread divided by time on several threads, for each pair of runs


def measure_scaling(threads: int, cores: tuple[int, ...], repeats: int) -> list[Scaling]:
    """Time steps on one thread and on `threads` threads, in alternating runs.

    Args:
        cores: cores to which the threads are bound; if empty, threads are not bound.
    Raises: DeviceError if a process fails.
    """
    with _start(1) as single, _start(threads, cores) as parallel:
        return [
            Scaling(substeps, threads, *compare_processes(single, parallel, str(substeps), repeats))
            for substeps in SUBSTEPS
        ]


def _start(threads: int, cores: tuple[int, ...] = ()) -> Process:
    program = _PROGRAM.format(threads=threads, cores=cores or None, bodies=BODIES, steps=STEPS_PER_TURN)
    advice = f"try `taichi-soft profile --threads {threads}`, which shows why"
    return Process(program, f"a process of {threads} threads", advice)
