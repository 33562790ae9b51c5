"""Break down the time of a frame into phases and the overhead of Python."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from engine_adapter import EngineAdapter, FixedStep
from taichi_soft.core.types import ScheduleName
from taichi_soft.elements.materials import Material
from taichi_soft.meshing import TetMesh, sphere
from taichi_soft.profiling.spread import Spread, time_calls
from taichi_soft.solver.kernels.phase_timing import PHASES, repeat_phase
from taichi_soft.world.bare import bare_world
from taichi_soft.world.world import World, context_of_world

MATERIAL = Material(young=1.0e6, poisson=0.1, density=1000.0, damping=100.0, damping_ratio=0.0)
SPACING = 3.0  # distance between the centres of spheres of radius 1 [m]
TINY_H = 1.0e-6  # substep [s], so short that nothing moves while phases are timed separately


@dataclass(frozen=True)
class Phases:
    """Times of one fixed step of equal bodies."""

    bodies: int
    tets: int
    substeps: int
    phases: dict[str, Spread]  # times on one thread, summed over the substeps [ms]
    frame: Spread  # time to advance and read all positions, on all threads [ms]
    read: Spread  # time to read all positions, a part of `frame` [ms]
    python: Spread  # overhead: time to advance and read a world of one tetrahedron [ms]


def spheres(count: int, schedule: ScheduleName = "auto", mesh: TetMesh | None = None) -> World:
    """Build a world of equal bodies in free fall; by default, spheres of 1,280 tetrahedra."""
    mesh = mesh or sphere(radius=1.0, resolution=4)
    world = bare_world(schedule=schedule)
    side = int(np.ceil(np.sqrt(count)))
    for i in range(count):
        world.add_body(
            mesh, MATERIAL, position=(SPACING * (i % side), SPACING * (i // side), 50.0), law="virial"
        )
    world.build()
    return world


def measure_phases(count: int = 16, dt: float = 1 / 60, repeats: int = 121) -> Phases:
    """Measure a world of `count` spheres with a fixed step of `dt` [s]."""
    world = spheres(count)
    substeps = world.stable_substeps(dt)
    adapter = EngineAdapter(world, FixedStep(dt=dt, substeps=substeps))
    buffers = [np.empty((body.vertex_count, 3), dtype=np.float32) for body in world.bodies]

    def read() -> None:
        for body, rows in zip(world.bodies, buffers, strict=True):
            adapter.positions(body, rows)

    def frame() -> None:
        adapter.step()
        read()

    time_calls(frame, 3)
    frames, reads = Spread.of(time_calls(frame, repeats)), Spread.of(time_calls(read, repeats))
    phases = {}
    for phase in PHASES:
        call = _phase_call(world, phase, substeps)
        time_calls(call, 2)
        phases[phase] = Spread.of(time_calls(call, 21)).scaled(1e3)
    return Phases(
        count,
        sum(len(body.tets) for body in world.bodies),
        substeps,
        phases,
        frames.scaled(1e3),
        reads.scaled(1e3),
        _measure_python(repeats).scaled(1e3),
    )


def _phase_call(world: World, phase: str, substeps: int) -> Callable[[], object]:
    built, count = context_of_world(world).built, len(world.bodies)
    return lambda: repeat_phase(built.state, built.program, phase, count, substeps, TINY_H)


def _measure_python(repeats: int) -> Spread:
    tetrahedron = TetMesh([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], [(0, 1, 2, 3)])
    world = spheres(1, mesh=tetrahedron)
    adapter = EngineAdapter(world, FixedStep(dt=1e-3, substeps=1))
    rows = np.empty((4, 3), dtype=np.float32)

    def frame() -> None:
        adapter.advance(1e-3)
        adapter.positions(world.bodies[0], rows)

    time_calls(frame, 5)
    return Spread.of(time_calls(frame, 5 * repeats))
