"""Estimate the number of bodies that can be stepped and read within a frame."""

from __future__ import annotations

from dataclasses import dataclass

from taichi_soft.profiling.phases import Phases, measure_phases

FRAME_RATES = (60, 120)  # [Hz]


@dataclass(frozen=True)
class Budget:
    """Number of spheres that can be stepped and read within a frame in 99 % of all frames."""

    rate: int  # frames per second [Hz]
    substeps: int
    bodies: int
    tets: int
    measured: Phases  # measured with another number of spheres; `bodies` is computed from these times


def measure_budget(count: int = 16, repeats: int = 121) -> list[Budget]:
    """Measure `count` spheres at each frame rate, and estimate the number of spheres that fits a frame.

    The estimate is proportional to `count`, and includes the fixed cost of a frame. The material determines
    the substep, so a frame of half the length needs half as many substeps.
    """
    found = []
    for rate in FRAME_RATES:
        phases = measure_phases(count, 1.0 / rate, repeats)
        bodies = int(count * 1e3 / rate / phases.frame.p99)
        found.append(Budget(rate, phases.substeps, bodies, bodies * phases.tets // count, phases))
    return found
