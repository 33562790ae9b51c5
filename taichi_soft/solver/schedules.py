"""Functions that launch the step of a world, one function per schedule."""

from collections.abc import Callable

from taichi_soft.bodies.kernels.origins import enter_all, leave_all
from taichi_soft.bodies.layout import Scene
from taichi_soft.core.runtime import Device
from taichi_soft.core.types import Schedule
from taichi_soft.solver.integrators import IntegratorModel
from taichi_soft.solver.kernels.flat import begin_flat, end_flat, finish_flat, step_flat_cpu, substep_flat
from taichi_soft.solver.kernels.step import UNFINISHED, step_islands
from taichi_soft.solver.program import StepProgram
from taichi_soft.solver.state import State

FLAT_FROM_TETS = 100_000
"""Size of the largest body, in tetrahedra, from which the schedule "auto" chooses FLAT on a CPU. On idle
cores, FLAT is faster even for much smaller bodies (`taichi-soft profile --crossover`). But if another
program occupies a core, a barrier waits milliseconds for the interrupted thread, and FLAT is faster only
for the largest bodies."""

MAX_CALL_WORK = 2_000_000
"""Largest product of tetrahedra and substeps in one kernel call. Ctrl-C waits until the call ends, so
calls must be short. A call takes 0.03 s on one thread, several times as long with contact, and up to 23
times as long if the step is retried. Before a step that needs several calls, the world takes a snapshot."""

ALL = 2**31 - 1
"""Limit of substeps per kernel call that lets one call run the whole step."""

Launch = Callable[[int, float], int]


def choose_schedule(asked: Schedule, scene: Scene, device: Device) -> Schedule:
    """Return the requested schedule, or the fastest schedule if the request is AUTO.

    A GPU uses FLAT, with one thread per tetrahedron. On a CPU, each body runs in one thread if there are
    enough bodies for all threads, or if no body is large enough for several threads.
    """
    if asked is not Schedule.AUTO:
        return asked
    if device.is_gpu:
        return Schedule.FLAT
    # For a body without tetrahedra, two edges count as one tetrahedron.
    sizes = [max(len(body.tet_vertices), len(body.edge_vertices) // 2) for body in scene.bodies]
    is_balanced = max(sizes) * device.threads <= 1.25 * sum(sizes)
    if device.threads == 1 or is_balanced or max(sizes) < FLAT_FROM_TETS:
        return Schedule.PER_BODY
    return Schedule.FLAT


def substeps_per_call(scene: Scene, integrator: IntegratorModel) -> int:
    """Return the largest number of substeps in one kernel call within `MAX_CALL_WORK`, at least 1."""
    sizes = [max(len(body.tet_vertices), len(body.edge_vertices) // 2) for body in scene.bodies]
    return max(1, MAX_CALL_WORK // max(1, integrator.work * sum(sizes)))


def make_launch(
    schedule: Schedule, state: State, program: StepProgram, scene: Scene, device: Device, retries: int = 0
) -> Launch:
    """Return the function that runs one fixed step: (substeps, h [s]) -> number of failed bodies.

    Args:
        retries: number of retries of a failed step.
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

    attempts = retries + 2 if retries else 1  # the last two attempts have the same substeps

    def flat_cpu(substeps: int, h: float) -> int:
        failed, attempt = 1, 0
        far = enter_all(state, bodies, 1)
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
        if far:
            leave_all(state, bodies)
        return failed

    def flat_gpu(substeps: int, h: float) -> int:
        far = enter_all(state, bodies, 1)
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
        if far:
            leave_all(state, bodies)
        return failed

    if schedule is Schedule.PER_BODY:
        return by_islands
    return flat_gpu if device.is_gpu else flat_cpu
