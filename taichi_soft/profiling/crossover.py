"""Find the number of tetrahedra above which several threads step a body faster than one thread."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from taichi_soft.meshing import box
from taichi_soft.profiling.phases import spheres
from taichi_soft.profiling.spread import Spread, compare

CELLS = (6, 10, 14, 18, 22, 28)
SUBSTEPS = 20


@dataclass(frozen=True)
class Crossover:
    """Times of one body with both schedules [ns per tetrahedron and substep]."""

    tets: int
    flat: Spread
    per_body: Spread
    ratio: Spread  # time with "flat" divided by time with "per_body", for each pair of runs


def measure_crossover(repeats: int = 21, cells: Sequence[int] = CELLS) -> list[Crossover]:
    """Time bodies of increasing size under both schedules, in alternating runs."""
    found = []
    for n in cells:
        mesh = box((1.0, 1.0, 1.0), (n, n, n))
        flat, per_body = (
            partial(spheres(1, schedule, mesh).step, SUBSTEPS * 1e-6, SUBSTEPS)
            for schedule in ("flat", "per_body")
        )
        found.append(
            Crossover(len(mesh.tets), *compare(flat, per_body, repeats, 1e9 / SUBSTEPS / len(mesh.tets)))
        )
    return found
