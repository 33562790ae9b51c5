"""Table and plot of the stress in all bodies of a world, for notebooks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft import StateError, TetMesh, World
from taichi_soft.render.colors import ColorScale

BARS = 24
"""Number of bars in the plot."""

WIDTH, HEIGHT = 480, 120  # size of the plot [pixels]


@dataclass(frozen=True)
class StressRow:
    """Stress of one body."""

    body: int  # slot of the body
    law: str  # force law
    largest: float  # largest von Mises stress of a tetrahedron [Pa]
    mean: float  # mean von Mises stress, weighted by volume [Pa]
    strain: float  # largest strain of a tetrahedron
    flipped: int  # number of inverted tetrahedra


@dataclass(frozen=True)
class StressTable:
    """Result of `stress_table`. Notebooks show a table and a stress histogram weighted by volume."""

    rows: tuple[StressRow, ...]  # stress of each body
    edges: NDArray[np.float64]  # limits of the bars' stress intervals [Pa], (BARS + 1,)
    volumes: NDArray[np.float64]  # volume of the material in each stress interval [m^3], (BARS,)

    def _repr_html_(self) -> str:
        names = "body", "law", "largest", "mean", "strain", "inverted"
        heads = "".join(f"<th>{name}</th>" for name in names)
        lines = "".join(
            f"<tr><td>{row.body}</td><td>{row.law}</td><td>{_pascals(row.largest)}</td>"
            f"<td>{_pascals(row.mean)}</td><td>{row.strain:.3g}</td><td>{row.flipped}</td></tr>"
            for row in self.rows
        )
        return f"<table><thead><tr>{heads}</tr></thead><tbody>{lines}</tbody></table>{self._bars()}"

    def _bars(self) -> str:
        high = max(float(self.edges[-1]), 1e-12)
        scale = ColorScale("stress", 0.0, high, "Pa")
        most = max(float(self.volumes.max(initial=0.0)), 1e-300)
        wide, bars = WIDTH / BARS, []
        colors = np.rint(255 * scale.colors((self.edges[1:] + self.edges[:-1]) / 2)).astype(int)
        for i, (volume, color) in enumerate(zip(self.volumes, colors, strict=True)):
            tall = HEIGHT * float(volume) / most
            place = f'x="{i * wide:.1f}" y="{HEIGHT - tall:.1f}" width="{wide - 1:.1f}" height="{tall:.1f}"'
            bars.append(f'<rect {place} fill="rgb({color[0]},{color[1]},{color[2]})"/>')
        low, top = scale.ticks()
        label = f"Histogram of material volume over stress, from {low} to {top}"
        head = f'<svg width="{WIDTH}" height="{HEIGHT + 20}" role="img" aria-label="{label}">'
        foot = f'<text x="0" y="{HEIGHT + 15}">{low}</text>'
        foot += f'<text x="{WIDTH}" y="{HEIGHT + 15}" text-anchor="end">{top}, von Mises</text>'
        return f"{head}{''.join(bars)}{foot}</svg>"


def stress_table(world: World) -> StressTable:
    """Compute the current stress of all tetrahedral bodies.

    Args:
        world: a built world with at least one tetrahedral body.
    Raises: StateError for a world that is not built or has no tetrahedral body.
    """
    if not world.is_built:
        raise StateError("the world is not built: call world.build() before stress_table(world)")
    bodies = [body for body in world.bodies if isinstance(body.mesh, TetMesh)]
    if not bodies:
        raise StateError("no body of this world has tetrahedra: only tetrahedra have stress")
    rows, stresses, volumes = [], [], []
    for body in bodies:
        stress, volume = body.tet_stress(), np.abs(body.volumes())
        mean = float(np.average(stress, weights=volume)) if volume.any() else float(stress.mean())
        law = str(body.asset.law)
        strain = float(body.tet_strain().max())
        rows.append(StressRow(body.index, law, float(stress.max()), mean, strain, body.flipped_count()))
        stresses.append(stress)
        volumes.append(volume)
    every = np.concatenate(stresses)
    counts, edges = np.histogram(
        every, BARS, (0.0, max(float(every.max()), 1e-12)), weights=np.concatenate(volumes)
    )
    return StressTable(tuple(rows), np.asarray(edges, np.float64), np.asarray(counts, np.float64))


def _pascals(value: float) -> str:
    return ColorScale("stress", 0.0, max(value, 1e-12), "Pa").ticks()[1]
