"""What made a body go non-finite: found out afterwards, by making its last step again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from taichi_soft.constants import LANES
from taichi_soft.kernels.evaluate import find_broken_element
from taichi_soft.kernels.program import Program
from taichi_soft.scene import Scene
from taichi_soft.state import State


@dataclass(frozen=True)
class Failure:
    """Why a body was frozen."""

    body: int
    tetrahedron: int | None  # that broke first, in the caller's order; None if it cannot be told
    step: int  # of the world, counted from 0, which was undone for this body
    substep: int | None  # within that step, or the finest attempt at it
    time: float  # [s], of the last sound state, in which the body now rests
    edge: tuple[int, int] | None = None  # instead of a tetrahedron where forces act along edges


@dataclass(frozen=True)
class FailedStep:
    """The fixed step in which a body went non-finite."""

    step: int
    time: float  # [s], before it
    substeps: int  # of the last attempt at it
    h: float  # [s]
    is_braked: bool  # whether vibrations were braked in it


def find_failure(state: State, program: Program, scene: Scene, body: int, failed: FailedStep) -> Failure:
    """Make the step that froze a body again and see where it breaks; the body stays as it is."""
    found = np.full(2, -1, dtype=np.int32)
    find_broken_element(state, program, body, failed.substeps, failed.h, int(failed.is_braked), found)
    element, substep = found.tolist()
    if element < 0:
        return Failure(body, None, failed.step, None, failed.time)
    place, arrays = scene.ranges[body], scene.bodies[body]
    if arrays.bonds is not None:
        p, q = arrays.order[arrays.edge_vertices[element - place.edges[0]]].tolist()
        return Failure(body, None, failed.step, substep, failed.time, edge=(p, q))
    row = min(element - place.blocks[0] * LANES, len(arrays.tet_order) - 1)
    return Failure(body, int(arrays.tet_order[row]), failed.step, substep, failed.time)
