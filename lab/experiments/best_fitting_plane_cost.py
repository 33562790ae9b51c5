"""Cost and stability of the best fitting plane and its cheap normal, compared with CMPM (thesis 4.4.2)."""

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
from lab.experiments.judgement import judged_but_for
from lab.experiments.law_stability import vibration
from lab.experiments.timing import in_turns
from taichi_soft import Material, TetMesh, World
from taichi_soft.core.types import LawName
from taichi_soft.world.bare import bare_world

MATERIAL = Material(1e6, 0.25, 1000.0, damping_ratio=0.0)
CMPM: LawName = "cmpm"
FITTED: LawName = "best_fitting_plane"
SPLIT: LawName = "split_ring_plane"
LAWS: tuple[LawName, ...] = (CMPM, FITTED, SPLIT)
AS_STABLE = 0.9
"""A law counts as equally stable if its largest stable step is at least this fraction of the largest stable
step with the best fitting plane."""
MESHES = ("another uneven block", "uneven block", "ball")
STEP, SUBSTEPS = 1e-4, 200
"""Length of a substep [s], and number of substeps of a timed call. The substeps are so short that a body at
rest stays at rest."""


def points(effort: Effort) -> list[Point]:
    """List the points: one per mesh. Each point compares all three laws."""
    size, repeats = (3, 5) if effort is Effort.QUICK else (6, 15)
    return [{"mesh": mesh, "size": size, "repeats": repeats} for mesh in MESHES]


def measure(point: Point) -> Numbers:
    """Measure the time of a substep and the small vibrations under each law.

    Returns: "seconds", median time of a substep [s]; "ratio", median ratio of this time to CMPM's in
        alternating calls; "step", largest stable step [s]; "growth_rate", growth rate of undamped vibrations
        [1/s]; "tets", number of tetrahedra.
    """
    mesh = mesh_of(point["mesh"], point["size"])
    step = {law: partial(_world(mesh, law).step, SUBSTEPS * STEP, SUBSTEPS) for law in LAWS}
    seconds: dict[str, float] = {}
    ratio: dict[str, float] = {}
    for law in (FITTED, SPLIT):
        own, other = (np.array(t) / SUBSTEPS for t in in_turns(step[CMPM], step[law], point["repeats"]))
        seconds |= {CMPM: float(np.median(own)), law: float(np.median(other))}
        ratio[law] = float(np.median(other / own))
    small = {law: vibration(mesh, MATERIAL, law) for law in LAWS}
    return {
        "seconds": seconds,
        "ratio": ratio,
        "step": {law: 2 / small[law].frequency for law in LAWS},
        "growth_rate": {law: small[law].growth_rate for law in LAWS},
        "tets": len(mesh.tets),
    }


def _world(mesh: TetMesh, law: LawName) -> World:
    world = bare_world(gravity=(0, 0, 0), floor=None, retries=0)
    world.add_body(mesh, MATERIAL, law=law)
    world.build()
    return world


def conclude(results: Results) -> Section:
    """Judge the cost, the largest step and the growth of vibrations on all meshes."""
    found = {mesh: results.one(mesh=mesh) for mesh in MESHES}
    slower = [numbers["ratio"][FITTED] for numbers in found.values()]
    steps = [numbers["step"][FITTED] / numbers["step"][CMPM] for numbers in found.values()]
    growths = [(numbers["growth_rate"][CMPM], numbers["growth_rate"][FITTED]) for numbers in found.values()]
    agrees = min(slower) > 1 and max(steps) < 1 and all(b > a for a, b in growths if max(a, b) > 1)
    finding = Finding(
        "best-fitting-plane-cost",
        f"a substep takes {min(slower):.1f} to {max(slower):.1f} times as long as CMPM's, the largest stable "
        f"step is {min(steps):.2f} to {max(steps):.2f} of it, and undamped vibrations grow at up to "
        f"{max(b for _, b in growths):.3g} /s against {max(a for a, _ in growths):.3g} /s",
        Verdict.AGREES if agrees else Verdict.DIFFERS,
        "" if agrees else "the mesh: what holds on some of these does not on others, see the table",
    )

    cheap = [numbers["ratio"][SPLIT] for numbers in found.values()]
    saved = [numbers["ratio"][FITTED] / numbers["ratio"][SPLIT] for numbers in found.values()]
    beside = [numbers["step"][SPLIT] / numbers["step"][FITTED] for numbers in found.values()]
    split_growth = [numbers["growth_rate"][SPLIT] for numbers in found.values()]
    unstable = [
        mesh
        for mesh, step, n in zip(MESHES, beside, found.values(), strict=True)
        if step < AS_STABLE or n["growth_rate"][SPLIT] > max(1.0, n["growth_rate"][FITTED])
    ]
    split = judged_but_for(
        "split-ring-cost",
        f"a substep takes {min(cheap):.1f} to {max(cheap):.1f} times as long as CMPM's, {min(saved):.1f} to "
        f"{max(saved):.1f} times less than that of the fitted plane; the largest stable step is "
        f"{min(beside):.2f} to {max(beside):.2f} of that plane's, and undamped vibrations grow at up to "
        f"{max(split_growth):.3g} /s. "
        f"Tolerance: {AS_STABLE:g} of that plane's step, and no faster growth, count as working as well",
        min(saved) > 1 and len(unstable) < len(MESHES),
        "the table shows on which meshes it costs more or is less stable than the best fitting plane",
        unstable,
        "its largest step is shorter than that of the best fitting plane, or its vibrations grow faster",
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
                axes.bar(place + (i - 1) * 0.27, values, 0.27, label=law)
            axes.set_xticks(place, [mesh.replace(" ", "\n") for mesh in MESHES], fontsize="x-small")
            axes.set_ylabel(label)
            if key == "step":
                axes.legend(fontsize="x-small", loc="upper left")
        figure.tight_layout()

    return Section(
        (
            "Each law runs in turns with CMPM on the same bodies. Stability is that of small vibrations at "
            "rest. Their highest frequency limits the step. Forces without an energy can also feed a "
            "vibration, which then grows however short the step is, and needs damping or softer material: "
            "the measures that the thesis had to take.",
        ),
        (finding, split),
        (
            Table(
                "cost",
                "Best fitting plane, split ring and CMPM",
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
    ("best-fitting-plane-cost", "split-ring-cost"),
    points,
    measure,
    conclude,
    is_timing=True,
)
