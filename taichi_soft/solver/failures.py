"""Find why a body became non-finite, by repeating the last step of the body."""

from __future__ import annotations

import numpy as np

from taichi_soft.bodies.failure import FailedStep, Failure
from taichi_soft.bodies.layout import Scene
from taichi_soft.core.constants import LANES
from taichi_soft.solver.kernels.failed_element import find_failed_element
from taichi_soft.solver.program import StepProgram
from taichi_soft.solver.state import State


def find_failure(state: State, program: StepProgram, scene: Scene, body: int, failed: FailedStep) -> Failure:
    """Repeat the step that froze a body, and return the element that failed first and the substep.

    The state of the body does not change.
    """
    found = np.full(2, -1, dtype=np.int32)
    find_failed_element(state, program, body, failed.substeps, failed.h, int(failed.is_braked), found)
    element, substep = found.tolist()
    if element < 0:
        return Failure(body, None, failed.step, None, failed.time)
    place, arrays = scene.ranges[body], scene.bodies[body]
    if arrays.bonds is not None:
        p, q = arrays.order[arrays.edge_vertices[element - place.edges[0]]].tolist()
        return Failure(body, None, failed.step, substep, failed.time, edge=(p, q))
    if arrays.rods is not None:
        row = min(element - place.particles[0], len(arrays.edge_order) - 1)
        p, q = sorted((row, (row + 1) % len(arrays.order)))
        return Failure(body, None, failed.step, substep, failed.time, edge=(p, q))
    if arrays.shells is not None:
        row = min(element - place.shells[0] * LANES, len(arrays.shells.order) - 1)
        return Failure(body, None, failed.step, substep, failed.time, triangle=int(arrays.shells.order[row]))
    row = min(element - place.blocks[0] * LANES, len(arrays.tet_order) - 1)
    return Failure(body, int(arrays.tet_order[row]), failed.step, substep, failed.time)
