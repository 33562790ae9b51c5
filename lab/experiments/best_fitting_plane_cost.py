"""What the best fitting plane costs, and how stable it is, beside CMPM (thesis section 4.4.2)."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from lab.experiments.anisotropy import mesh_of
from lab.experiments.experiment import (
    Effort,
    Experiment,
    Finding,
    Numbers,
    Plot,
    Point,
    Results,
    Section,
    Table,
    Verdict,
)
from lab.experiments.law_stability import vibration
from lab.experiments.timing import in_turns
from taichi_soft import Material, TetMesh, World
from taichi_soft.core.types import LawName

MATERIAL = Material(1e6, 0.25, 1000.0, damping_ratio=0.0)
LAWS: tuple[LawName, ...] = ("cmpm", "best_fitting_plane")
MESHES = ("another uneven block", "uneven block", "ball")
STEP, SUBSTEPS = 1e-4, 200
"""Of what is timed: so short that bodies at rest stay there."""


def points(effort: Effort) -> list[Point]:
    """Both laws in turns on three meshes."""
    size, repeats = (3, 5) if effort is Effort.QUICK else (6, 15)
    return [{"mesh": mesh, "size": size, "repeats": repeats} for mesh in MESHES]


def measure(point: Point) -> Numbers:
    """Time of a substep [s], medians in turns, and vibrations of both laws."""
    mesh = mesh_of(point["mesh"], point["size"])
    steps = [partial(_world(mesh, law).step, SUBSTEPS * STEP, SUBSTEPS) for law in LAWS]
    fast, slow = (np.array(times) / SUBSTEPS for times in in_turns(steps[0], steps[1], point["repeats"]))
    small = {law: vibration(mesh, MATERIAL, law) for law in LAWS}
    return {
        "seconds": {LAWS[0]: float(np.median(fast)), LAWS[1]: float(np.median(slow))},
        "ratio": float(np.median(slow / fast)),
        "step": {law: 2 / small[law].frequency for law in LAWS},
        "growth_rate": {law: small[law].growth_rate for law in LAWS},
        "tets": len(mesh.tets),
    }


def _world(mesh: TetMesh, law: LawName) -> World:
    world = World(gravity=(0, 0, 0), floor=None, retries=0)
    world.add_body(mesh, MATERIAL, law=law)
    world.build()
    return world


def conclude(results: Results) -> Section:
    """Slower on all meshes, and less stable: shorter steps and faster growth."""
    found = {mesh: results.one(mesh=mesh) for mesh in MESHES}
    cmpm, plane = LAWS
    slower = [numbers["ratio"] for numbers in found.values()]
    steps = [numbers["step"][plane] / numbers["step"][cmpm] for numbers in found.values()]
    growths = [(numbers["growth_rate"][cmpm], numbers["growth_rate"][plane]) for numbers in found.values()]
    agrees = min(slower) > 1 and max(steps) < 1 and all(b > a for a, b in growths if max(a, b) > 1)
    finding = Finding(
        "best-fitting-plane-cost",
        f"a substep takes {min(slower):.1f} to {max(slower):.1f} times as long as CMPM's, the largest stable "
        f"step is {min(steps):.2f} to {max(steps):.2f} of it, and undamped vibrations grow at up to "
        f"{max(b for _, b in growths):.3g} /s against {max(a for a, _ in growths):.3g} /s",
        Verdict.AGREES if agrees else Verdict.DIFFERS,
        "" if agrees else "the mesh: what holds on some of these does not on others, see the table",
    )

    def draw(figure: Any) -> None:
        place = np.arange(len(MESHES))
        panels = (
            ("seconds", 1e6, "time of a substep [us]"),
            ("step", 1e3, "largest stable step [ms]"),
            ("growth_rate", 1.0, "growth of vibrations [1/s]"),
        )
        for panel, (key, factor, label) in enumerate(panels):
            axes = figure.add_subplot(1, 3, panel + 1)
            for i, law in enumerate(LAWS):
                values = [factor * found[mesh][key][law] for mesh in MESHES]
                axes.bar(place + (i - 0.5) * 0.4, values, 0.4, label=law)
            axes.set_xticks(place, [mesh.replace(" ", "\n") for mesh in MESHES], fontsize="x-small")
            axes.set_ylabel(label)
            if key == "step":
                axes.legend(fontsize="x-small", loc="upper left")
        figure.tight_layout()

    return Section(
        (
            "Both laws run in turns on the same bodies. Stability is that of small vibrations at rest: their "
            "highest frequency limits the step; but forces without an energy may also feed a vibration, "
            "which then grows however short the step is, and needs damping or softer material: the "
            "measures that the thesis had to take.",
        ),
        (finding,),
        (
            Table(
                "cost",
                "Best fitting plane and CMPM",
                (
                    "mesh",
                    "tetrahedra",
                    *(
                        f"{law}: {what}"
                        for what in ("substep [us]", "largest step [ms]", "growth [1/s]")
                        for law in LAWS
                    ),
                ),
                tuple(
                    (
                        mesh,
                        numbers["tets"],
                        *(
                            f"{factor * numbers[key][law]:.3g}"
                            for key, factor in (("seconds", 1e6), ("step", 1e3), ("growth_rate", 1.0))
                            for law in LAWS
                        ),
                    )
                    for mesh, numbers in found.items()
                ),
            ),
        ),
        (
            Plot(
                "cost",
                "Time of a substep, largest stable step, and growth of vibrations at any step.",
                draw,
                (9.0, 3.4),
            ),
        ),
    )


BEST_FITTING_PLANE_COST = Experiment(
    "best-fitting-plane-cost",
    "Cost of the best fitting plane",
    "section 4.4.2",
    ("best-fitting-plane-cost",),
    points,
    measure,
    conclude,
    is_timing=True,
)
