"""Find the number of tetrahedra above which a GPU is faster than the CPU's threads.

Each device is measured in its own process.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from engine_adapter import EngineAdapter, FixedStep
from taichi_soft.core.types import ArchName
from taichi_soft.meshing import TetMesh, box, sphere
from taichi_soft.profiling.phases import TINY_H, spheres
from taichi_soft.profiling.process import Process, compare_processes
from taichi_soft.profiling.spread import Spread, time_calls

SUBSTEPS = 8
SCENES = ((1, 6), (1, 14), (1, 28), (16, 0), (256, 0))
"""Number of bodies in each scene, and number of cells along each side of a box. With 0 cells, the body is a
sphere of 1,280 tetrahedra. The bodies do not touch."""

STEPS_PER_TURN = 3

_PROGRAM = """
import sys
from taichi_soft import init
init({arch!r}, {threads!r}, {cores!r})
from taichi_soft.profiling.devices import Frames
frames = Frames()
for line in sys.stdin:
    print(frames.time(*map(int, line.split())), flush=True)
"""


@dataclass(frozen=True)
class DeviceGain:
    """Time of a frame on the CPU and on a GPU [ms]. A frame has 8 substeps and reads all positions."""

    bodies: int
    tets: int
    cpu: Spread
    gpu: Spread
    gain: Spread  # time of the CPU divided by time of the GPU, for each pair of runs


class Frames:
    """Times the frames of several scenes in this process."""

    def __init__(self) -> None:
        self._scene: tuple[int, int] | None = None
        self._frame: Callable[[], None] = lambda: None

    def time(self, bodies: int, cells: int) -> float:
        """Return the median time of a few frames [s]."""
        if self._scene != (bodies, cells):
            self._scene, self._frame = (bodies, cells), _make_frame(bodies, cells)
        return Spread.of(time_calls(self._frame, STEPS_PER_TURN)).median


def _make_frame(bodies: int, cells: int) -> Callable[[], None]:
    world = spheres(bodies, mesh=_mesh(cells))
    adapter = EngineAdapter(world, FixedStep(dt=SUBSTEPS * TINY_H, substeps=SUBSTEPS))
    buffers = [np.empty((body.vertex_count, 3), dtype=np.float32) for body in world.bodies]

    def frame() -> None:
        adapter.step()
        for body, rows in zip(world.bodies, buffers, strict=True):
            adapter.positions(body, rows)

    return frame


def measure_devices(
    gpu: ArchName,
    threads: int,
    cores: tuple[int, ...],
    repeats: int,
    scenes: tuple[tuple[int, int], ...] = SCENES,
) -> list[DeviceGain]:
    """Time frames on CPU threads and on a GPU, in alternating runs.

    Args:
        gpu: "cuda", "vulkan" or "metal".
        threads: number of CPU threads.
        cores: cores to which the threads are bound; if empty, threads are not bound.
        repeats: number of pairs of runs.
        scenes: see `SCENES`.
    Raises: DeviceError if a process fails, for example because the machine has no such GPU.
    """
    with _start("cpu", threads, cores) as one, _start(gpu, None, None) as other:
        return [_compare(one, other, *scene, repeats) for scene in scenes]


def _start(arch: ArchName, threads: int | None, cores: tuple[int, ...] | None) -> Process:
    program = _PROGRAM.format(arch=arch, threads=None if cores else threads, cores=cores or None)
    advice = f"try `taichi-soft profile --arch {arch}`, which shows why"
    return Process(program, f"a process on {arch!r}", advice)


def _compare(cpu: Process, gpu: Process, bodies: int, cells: int, repeats: int) -> DeviceGain:
    tets = bodies * len(_mesh(cells).tets)
    return DeviceGain(bodies, tets, *compare_processes(cpu, gpu, f"{bodies} {cells}", repeats))


def _mesh(cells: int) -> TetMesh:
    return box((1.0, 1.0, 1.0), (cells,) * 3) if cells else sphere(radius=1.0, resolution=4)
