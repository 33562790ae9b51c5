"""How long a new process takes to its first frame, with an empty kernel cache and with a full one."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass

from taichi_soft.core.errors import DeviceError
from taichi_soft.core.types import ArchName

_PROGRAM = """
import numpy as np
from engine_adapter import EngineAdapter, FixedStep
from taichi_soft import World, init, preset, sphere
init({arch!r}, {threads!r}, {cores!r})
world = World()
body = world.add_body(sphere(radius=1.0), preset("thesis_sphere"), position=(0, 0, 3), law="virial")
world.build()
game = EngineAdapter(world, FixedStep(dt=1 / 60))
game.step()
game.positions(body, np.empty((body.vertex_count, 3), np.float32))
"""


@dataclass(frozen=True)
class Startup:
    """From starting Python to the first positions [s]."""

    cold: float  # nothing compiled before
    warm: float  # kernels in Taichi's offline cache


def measure_startup(arch: ArchName, threads: int, cores: tuple[int, ...]) -> Startup:
    """Run a small game twice in processes of their own, with a cache of their own.

    Args:
        cores: to which the threads are bound, or none.
    Raises: DeviceError if such a process fails.
    """
    program = _PROGRAM.format(arch=arch, threads=threads, cores=cores or None)
    with tempfile.TemporaryDirectory(prefix="taichi-soft-") as folder:
        environment = {**os.environ, "TI_OFFLINE_CACHE_FILE_PATH": folder}
        return Startup(_time_process(program, environment), _time_process(program, environment))


def _time_process(program: str, environment: dict[str, str]) -> float:
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        raise DeviceError(f"a new process failed: {(done.stderr.strip().splitlines() or ['no message'])[-1]}")
    return time.perf_counter() - start
