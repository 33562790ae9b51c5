"""Time the start of a process until its game can begin, with an empty kernel cache and with a full one."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass

from taichi_soft.core.errors import DeviceError
from taichi_soft.core.types import ArchName

PROGRAM = """
import time
import numpy as np
from engine_adapter import EngineAdapter, FixedStep
from taichi_soft import BoxShape, Material, SoftBodyAsset, World, box, init, sphere
init({arch!r}, {threads!r}, {cores!r})
rubber = Material(young=3e5, poisson=0.3, density=1000)
{world}
world.build()
game = EngineAdapter(world, FixedStep(dt=1 / 60))
game.step()
game.positions(body, np.empty((body.vertex_count, 3), np.float32))
print(time.time())
world.warm_up()
print(time.time())
"""

WORLDS = {
    "plain": """
world = World()
body = world.add_body(sphere(radius=0.5), rubber, position=(0, 0, 3))
""",
    "contact": """
world = World()
body = world.add_body(box((1, 1, 1), (3, 3, 3)), rubber, position=(0, 0, 0.52))
world.reserve(SoftBodyAsset(sphere(radius=0.3), rubber), 4)
world.add_collider(BoxShape((2, 2, 0.2)), position=(3, 0, 0.1))
""",
    "cutting": """
world = World()
body = world.add_body(box((1, 1, 1), (3, 3, 3)), rubber, position=(0, 0, 3), spare_vertices=200)
""",
}
"""Code that makes each world, by name. "plain": a body and a floor. "contact": soft contact, a pool and a
collider. "cutting": a body that can be cut."""


@dataclass(frozen=True)
class Startup:
    """Time from the start of Python to the first frame, and until all kernels are compiled."""

    world: str  # key of `WORLDS`
    cache: str  # "empty", or "full" after an earlier run of the same program
    first_frame: float  # time until the first frame [s]
    warm: float  # time until the end of `World.warm_up` [s]


def measure_startup(
    arch: ArchName, threads: int, cores: tuple[int, ...], worlds: tuple[str, ...] = tuple(WORLDS)
) -> list[Startup]:
    """Run a small game of each world twice, in new processes with a separate cache.

    Python's bytecode is precompiled, as after an installation.

    Args:
        cores: cores to which the threads are bound; if empty, threads are not bound.
        worlds: keys of `WORLDS`.
    Raises: DeviceError if a process fails.
    """
    found = []
    with tempfile.TemporaryDirectory(prefix="taichi-soft-") as folder:
        shared = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
        shared["PYTHONPYCACHEPREFIX"] = f"{folder}/bytecode"
        _run("import engine_adapter", shared)
        for name in worlds:
            program = PROGRAM.format(arch=arch, threads=threads, cores=cores or None, world=WORLDS[name])
            environment = {**shared, "TI_OFFLINE_CACHE_FILE_PATH": f"{folder}/{name}"}
            found += [Startup(name, cache, *_times_of(program, environment)) for cache in ("empty", "full")]
    return found


def _times_of(program: str, environment: dict[str, str]) -> tuple[float, float]:
    """Run a program and return the two times that it prints, relative to its start [s]."""
    start = time.time()
    first_frame, warm = (float(line) - start for line in _run(program, environment).split())
    return first_frame, warm


def _run(program: str, environment: dict[str, str]) -> str:
    """Run a program and return its output."""
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        raise DeviceError(f"a new process failed: {(done.stderr.strip().splitlines() or ['no message'])[-1]}")
    return done.stdout
