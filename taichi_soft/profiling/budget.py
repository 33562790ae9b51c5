"""How many bodies fit a frame."""

from __future__ import annotations

from dataclasses import dataclass

from taichi_soft.profiling.phases import Phases, measure_phases

FRAME_RATES = (60, 120)  # [Hz]


@dataclass(frozen=True)
class Budget:
    """Spheres that can be stepped and read within a whole frame of one rate, at its 99th percentile."""

    rate: int  # [Hz]
    substeps: int
    bodies: int
    tets: int
    measured: Phases  # what this is scaled from


def measure_budget(count: int = 16, repeats: int = 121) -> list[Budget]:
    """Measure `count` spheres at each rate and scale to a full frame, what a frame costs by itself included.

    The substep is limited by the material, so a frame twice as short needs half the substeps.
    """
    found = []
    for rate in FRAME_RATES:
        phases = measure_phases(count, 1.0 / rate, repeats)
        bodies = int(count * 1e3 / rate / phases.frame.p99)
        found.append(Budget(rate, phases.substeps, bodies, bodies * phases.tets // count, phases))
    return found
