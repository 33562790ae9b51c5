"""Compare the times of Taichi and plain C++ per element and substep, in alternating runs of one process."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import partial

import numpy as np

from taichi_soft.bodies.description import BodyDescription
from taichi_soft.bodies.layout import arrange
from taichi_soft.core.types import LawName
from taichi_soft.elements.laws import element_model
from taichi_soft.elements.materials import Material
from taichi_soft.meshing import box
from taichi_soft.profiling.baseline import Baseline
from taichi_soft.profiling.spread import Spread, compare
from taichi_soft.world.bare import bare_world

SIZES = {25_000: (17, 17, 17), 5_000: (10, 10, 10), 1_000: (6, 6, 6)}
"""Cells of a box along x, y and z, by approximate number of tetrahedra. The largest box is first, because the
smaller boxes reuse its kernels."""

MATERIAL = Material(young=1.0e5, poisson=0.1, density=1000.0, damping=0.1, damping_ratio=0.0)
SUBSTEP = 1.0e-5  # length of a substep [s], far below the stable limit
PUSHED_APART = 0.02  # initial stretch of the body, so that elastic forces act


NATIVE_LAWS: tuple[LawName, ...] = ("virial", "springs", "volume_springs")
"""Laws that `baseline.cpp` implements."""


@dataclass(frozen=True)
class Comparison:
    """Times of one body on one thread, in Taichi and in C++."""

    law: LawName
    element: str  # "tetrahedron" or "edge"
    tets: int
    taichi: Spread  # time in Taichi, including Python [ns per element and substep]
    native: Spread
    ratio: Spread  # time in Taichi divided by time in C++, for each pair of runs
    deviation: float  # largest difference of positions after equal steps, divided by the body's size


def compare_with_baseline(
    library: ctypes.CDLL,
    repeats: int = 31,
    sizes: dict[int, tuple[int, int, int]] = SIZES,
    laws: tuple[LawName, ...] = NATIVE_LAWS,
) -> list[Comparison]:
    """Compare every law and size with `library`, the result of `compile_baseline`."""
    return [_compare(library, repeats, cells, law) for law in laws for cells in sizes.values()]


def _compare(library: ctypes.CDLL, repeats: int, cells: tuple[int, int, int], law: LawName) -> Comparison:
    mesh = box((1.0, 1.0, 1.0), cells)
    world = bare_world(floor=None, schedule="per_body")
    body = world.add_body(mesh, MATERIAL, law=law, position=(0.0, 0.0, 1.0))
    world.build()
    model = element_model(law)
    arrays = arrange(BodyDescription(mesh, MATERIAL, model))
    native = Baseline(library, arrays)
    stretched = mesh.vertices * (1.0 + PUSHED_APART) + (0.0, 0.0, 1.0)
    body.set_motion(stretched, np.zeros_like(stretched))
    native.positions[:] = stretched[arrays.order]
    element, count = ("edge", len(mesh.edges)) if model.has_bonds else ("tetrahedron", len(mesh.tets))
    substeps = max(4, 2_000_000 // len(mesh.tets) // 10)
    dt = substeps * SUBSTEP
    ours, theirs = partial(world.step, dt, substeps), partial(native.step, substeps, SUBSTEP)
    spreads = compare(ours, theirs, repeats, 1e9 / substeps / count)
    moved = np.abs(body.positions()[arrays.order] - native.positions).max()
    return Comparison(law, element, len(mesh.tets), *spreads, float(moved / np.ptp(mesh.vertices)))
