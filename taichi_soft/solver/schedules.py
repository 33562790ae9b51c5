"""How the step of a world is launched: one object per schedule, one call per fixed step."""

from collections.abc import Callable

from taichi_soft.bodies.layout import Scene
from taichi_soft.core.runtime import Device
from taichi_soft.core.types import Schedule
from taichi_soft.solver.integrators import IntegratorModel
from taichi_soft.solver.kernels.flat import begin_flat, end_flat, finish_flat, step_flat_cpu, substep_flat
from taichi_soft.solver.kernels.step import UNFINISHED, step_islands
from taichi_soft.solver.program import StepProgram
from taichi_soft.solver.state import State

FLAT_FROM_TETS = 100_000
"""Tetrahedra in a world's largest body from which the threads share it rather than leave it to one of them.
Measured with `taichi-soft profile --crossover`: with both cores free, two threads win from some 5,000 on
(0.83 of the time, 0.69 at 110,000). But a barrier that waits for a thread which another program has pushed
off its core stands still for milliseconds: with a third process at work, bodies of 1,000 to 50,000 ran 4 to
300 times slower than on one thread, and only the largest still won."""

MAX_CALL_WORK = 2_000_000
"""Tetrahedra times substeps of one call of a kernel, at most: some 0.03 s on one thread, several times as
much where bodies touch, and up to 23 times where a step is made again. While a kernel runs, Python hears no
Ctrl-C. A longer step takes a snapshot first: some 5 % of its time, and it is no step of a game."""

ALL = 2**31 - 1
"""Substeps of one call of a kernel that makes the whole step."""

Launch = Callable[[int, float], int]


def choose_schedule(asked: Schedule, scene: Scene, device: Device) -> Schedule:
    """The schedule to use where `asked` leaves it open.

    A GPU needs one thread per tetrahedron. On a CPU, bodies run side by side as long as there are enough
    of them to keep the threads busy, or too few tetrahedra to be worth sharing.
    """
    if asked is not Schedule.AUTO:
        return asked
    if device.is_gpu:
        return Schedule.FLAT
    # A body without tetrahedra works on its edges, of which there are about twice as many per unit of work.
    sizes = [max(len(body.tet_vertices), len(body.edge_vertices) // 2) for body in scene.bodies]
    is_balanced = max(sizes) * device.threads <= 1.25 * sum(sizes)
    if device.threads == 1 or is_balanced or max(sizes) < FLAT_FROM_TETS:
        return Schedule.PER_BODY
    return Schedule.FLAT


def substeps_per_call(scene: Scene, integrator: IntegratorModel) -> int:
    """How many substeps a step of a world may have that one call of a kernel makes."""
    sizes = [max(len(body.tet_vertices), len(body.edge_vertices) // 2) for body in scene.bodies]
    return max(1, MAX_CALL_WORK // max(1, integrator.work * sum(sizes)))


def make_launch(
    schedule: Schedule, state: State, program: StepProgram, scene: Scene, device: Device, retries: int = 0
) -> Launch:
    """A function (substeps, h) -> number of bodies that failed, which makes one fixed step.

    `retries`: how often a step that fails is made again.
    """
    bodies, particles = len(scene.bodies), scene.particle_count
    blocks, edges = scene.block_count, scene.edge_count

    helpers = 0 if device.is_gpu else min(device.threads, bodies) - 1
    stretch = substeps_per_call(scene, program.integrator)

    def by_islands(substeps: int, h: float) -> int:
        most = stretch if substeps > stretch else ALL
        found = int(step_islands(state, program, bodies, helpers, substeps, h, most, 0))
        while found == UNFINISHED:
            found = int(step_islands(state, program, bodies, helpers, substeps, h, most, 1))
        return found

    attempts = retries + 2 if retries else 1  # the last as fine as the one before it

    def flat_cpu(substeps: int, h: float) -> int:
        failed, attempt = 1, 0
        most = stretch if substeps > stretch else ALL
        while failed and attempt < attempts:
            finer = 1 << min(attempt, retries)
            count, first = finer * substeps, 0
            while first < count:
                last = min(first + most, count)
                counts = bodies, blocks, edges, particles, count
                which = first, last, attempt, attempts
                failed = int(step_flat_cpu(state, program, *counts, h / finer, *which))
                first = last
            attempt += 1
        return failed

    def flat_gpu(substeps: int, h: float) -> int:
        begin_flat(state, particles)
        failed, attempt = 1, 0
        while failed and attempt < attempts:
            finer = 1 << min(attempt, retries)
            count = finer * substeps
            for s in range(count):
                substep_flat(state, program, bodies, blocks, edges, particles, count, h / finer, s)
            failed = int(
                end_flat(state, program, bodies, blocks, particles, count, h / finer, attempt, attempts)
            )
            attempt += 1
        finish_flat(state, bodies)
        return failed

    if schedule is Schedule.PER_BODY:
        return by_islands
    return flat_gpu if device.is_gpu else flat_cpu
