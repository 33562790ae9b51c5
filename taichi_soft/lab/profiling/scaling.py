"""How much faster many bodies run on several threads. Taichi's thread count is fixed per process."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass

from taichi_soft.core.errors import DeviceError
from taichi_soft.lab.profiling.spread import Spread

BODIES = 64
SUBSTEPS = (4, 14)
"""Of a step: what this body needs at 60 Hz, and the thesis's 700 per second at 50 Hz."""

WARM_TURNS = 2
STEPS_PER_TURN = 5

_PROGRAM = """
import sys
from functools import partial
from taichi_soft import init
init("cpu", {threads}, {cores})
from taichi_soft.lab.profiling.phases import spheres
from taichi_soft.lab.profiling.spread import Spread, time_calls
step = partial(spheres({bodies}).step, 1e-3)
for line in sys.stdin:
    print(Spread.of(time_calls(partial(step, int(line)), {steps})).median, flush=True)
"""


@dataclass(frozen=True)
class Scaling:
    """One step of 64 spheres [ms], on one thread and on several."""

    substeps: int
    threads: int
    single: Spread
    parallel: Spread
    speedup: Spread  # pair by pair


class _Stepper:
    """A process of its own that makes steps when asked."""

    def __init__(self, threads: int, cores: tuple[int, ...] = ()) -> None:
        program = _PROGRAM.format(threads=threads, cores=cores or None, bodies=BODIES, steps=STEPS_PER_TURN)
        self._threads = threads
        self._process = subprocess.Popen(
            [sys.executable, "-c", program],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def __enter__(self) -> _Stepper:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.communicate()

    def time_step(self, substeps: int) -> float:
        """What a step takes [s]. Raises: DeviceError if the process has failed."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(f"{substeps}\n")
            self._process.stdin.flush()
            return float(self._process.stdout.readline())
        except (OSError, ValueError):
            raise DeviceError(
                f"a process of {self._threads} threads failed: try `taichi-soft profile --threads "
                f"{self._threads}`, which shows why"
            ) from None


def measure_scaling(threads: int, cores: tuple[int, ...], repeats: int) -> list[Scaling]:
    """Time one thread and `threads`, in turns: a machine that slows down for a while slows both.

    Args:
        cores: to which the latter are bound, or none.
    Raises: DeviceError if a process fails.
    """
    with _Stepper(1) as single, _Stepper(threads, cores) as parallel:
        return [_compare(single, parallel, threads, substeps, repeats) for substeps in SUBSTEPS]


def _compare(single: _Stepper, parallel: _Stepper, threads: int, substeps: int, repeats: int) -> Scaling:
    turns = range(WARM_TURNS + repeats)
    pairs = [(single.time_step(substeps), parallel.time_step(substeps)) for _ in turns][WARM_TURNS:]
    ones, others = zip(*pairs, strict=True)
    return Scaling(
        substeps,
        threads,
        Spread.of(list(ones)).scaled(1e3),
        Spread.of(list(others)).scaled(1e3),
        Spread.of([one / other for one, other in pairs]),
    )
