"""From which size on the threads should share one body rather than leave it to one of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from taichi_soft.meshing import box
from taichi_soft.profiling.phases import spheres
from taichi_soft.profiling.spread import Spread, time_in_turns

CELLS = (6, 10, 14, 18, 22, 28)
SUBSTEPS = 20


@dataclass(frozen=True)
class Crossover:
    """One body under both schedules [ns per tetrahedron and substep]."""

    tets: int
    per_body: Spread
    flat: Spread
    ratio: Spread  # flat over per_body, pair by pair


def measure_crossover(repeats: int = 21, cells: Sequence[int] = CELLS) -> list[Crossover]:
    """Time one body of growing size, in turns."""
    found = []
    for n in cells:
        mesh = box((1.0, 1.0, 1.0), (n, n, n))
        worlds = [spheres(1, schedule, mesh) for schedule in ("per_body", "flat")]
        dt = SUBSTEPS * 1e-6
        calls = [partial(world.step, dt, SUBSTEPS) for world in worlds]
        time_in_turns(calls, 2)
        one, all_threads = time_in_turns(calls, repeats)
        per = 1e9 / SUBSTEPS / len(mesh.tets)
        ratios = [b / a for a, b in zip(one, all_threads, strict=True)]
        found.append(
            Crossover(
                len(mesh.tets),
                Spread.of(one).scaled(per),
                Spread.of(all_threads).scaled(per),
                Spread.of(ratios),
            )
        )
    return found
