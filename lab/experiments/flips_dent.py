"""Tetrahedra that invert on a hard impact and stay inverted, as dents (thesis section 6.6).

The thesis's sphere is thrown at the floor with each treatment of inverted tetrahedra: "tolerant" as in the
thesis, "off", and "recover".
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.experiments.experiment import (
    Effort,
    Experiment,
    Finding,
    Numbers,
    Picture,
    Plot,
    Point,
    Results,
    Section,
    Table,
    Verdict,
)
from taichi_soft import FrozenBodyWarning, Material, load_mesh
from taichi_soft.core.package_data import ASSETS
from taichi_soft.world.bare import bare_world

MATERIAL = Material(young=1e6, poisson=0.1, density=1000.0, damping=100.0, damping_ratio=0.0)
SPEED, HEIGHT = 20.0, 1.05  # initial speed [m/s] and height [m] of the sphere
STEP = 1 / 700  # length of a step in the thesis [s]
SECONDS = 5.0
FLIPS = ("tolerant", "off", "recover")
MANY, STAYS, PLACED, APART = 0.01, 0.8, 0.5, 1.5
"""Limits of the verdict. The sphere is dented if it satisfies three conditions. More than `MANY` of its
tetrahedra are inverted at the end. More than `STAYS` of the tetrahedra that are inverted at half-time are
also inverted at the end. More than `PLACED` of the inverted tetrahedra are in the most compressed quarter of
the tetrahedra (by chance, the fraction would be 0.25). The sphere failed if its extent reaches `APART` times
its extent at rest."""


def points(effort: Effort) -> list[Point]:
    """List the points: every treatment of flips at one speed, or at three."""
    speeds = (SPEED,) if effort is Effort.QUICK else (17.0, SPEED, 24.0)
    return [{"flips": flips, "speed": speed} for speed in speeds for flips in FLIPS]


def measure(point: Point) -> Numbers:
    """Measure which tetrahedra invert during the impact and in the seconds after it."""
    mesh = load_mesh(ASSETS / "sphere.npz")
    rest = mesh.vertices
    world = bare_world(retries=0)
    body = world.add_body(
        mesh,
        MATERIAL,
        flips=point["flips"],
        position=(0, 0, HEIGHT),
        velocity=(0, 0, -point["speed"]),
        law="virial",
    )
    world.build()
    size = float(np.ptp(rest, axis=0).max())
    time, flipped, extent = [], [], 0.0
    squeeze: NDArray[np.floating] = np.zeros(len(mesh.tets))
    early = body.flipped_tets()
    pose = body.positions()
    begun = False
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FrozenBodyWarning)
        while world.time < SECONDS - 1e-9 and not body.is_frozen:
            substeps = 1 if world.time < 0.1 else 14
            world.step(substeps * STEP, substeps)
            inside_out = body.flipped_tets()
            if not begun and len(inside_out) == 0:
                squeeze = 1.0 - np.linalg.svd(body.deformations(), compute_uv=False)[:, 2]
            begun = begun or len(inside_out) > 0
            if world.time < SECONDS / 2:
                early = inside_out
            pose = body.positions()
            extent = max(extent, float(np.ptp(pose, axis=0).max()) / size)
            time.append(world.time)
            flipped.append(len(inside_out) / len(mesh.tets))
    late = body.flipped_tets()
    pressed = np.argsort(squeeze)[-len(squeeze) // 4 :]
    heights = rest[mesh.tets].mean(axis=1)[:, 2]
    return {
        "time": time,
        "flipped": flipped,
        "extent": extent,
        "frozen": body.is_frozen,
        "kept": float(np.isin(early, late).mean()) if len(early) else 0.0,
        "in_pressed": float(np.isin(late, pressed).mean()) if len(late) else 0.0,
        "pressed_height": float(heights[pressed].mean()),
        "flipped_height": float(heights[late].mean()) if len(late) else 0.0,
        "volume": body.volume() / mesh.volume,
        "pose": np.round(pose, 3).tolist(),
    }


def conclude(results: Results) -> Section:
    """Judge whether flips leave dents in the compressed region, and whether a body fails."""
    by_flips = {flips: results.one(flips=flips, speed=SPEED) for flips in FLIPS}
    thesis = {point["speed"]: numbers for point, numbers in results.where(flips="tolerant")}
    dented = [speed for speed, numbers in thesis.items() if _is_dented(numbers)]
    sound = not any(numbers["frozen"] or numbers["extent"] >= APART for numbers in thesis.values())

    def percent(shares: Iterable[float]) -> str:
        return _listed(round(100 * share) for share in shares)

    all_numbers = thesis.values()
    measured = (
        f"thrown down at {_listed(thesis)} m/s, {percent(n['flipped'][-1] for n in all_numbers)} % of the "
        f"tetrahedra are inside out in the end, {percent(n['in_pressed'] for n in all_numbers)} % of these "
        "in the quarter that was pressed most just before the first flip; "
        f"{percent(n['kept'] for n in all_numbers)} % of those flipped at half-time stay; the body never is "
        f"longer than {max(numbers['extent'] for numbers in thesis.values()):.2f} times its size"
    )
    if not sound:
        verdict, why = Verdict.DIFFERS, "the model: the body runs away"
    elif max(max(numbers["flipped"]) for numbers in thesis.values()) <= MANY:
        verdict, why = Verdict.UNKNOWN, "nothing flips: the impact is not strong enough"
    elif len(dented) == len(thesis):
        verdict, why = Verdict.AGREES, ""
    elif dented:
        verdict = Verdict.UNKNOWN
        why = (
            f"at {_listed(dented)} m/s they stay, more than half of them where most was pressed; not so at "
            "the other speeds, and the thesis does not say how hard its body hit the floor"
        )
    else:
        verdict, why = Verdict.DIFFERS, "the model: flips do not stay, or not where most is pressed"
    said = {name: _fate(numbers) for name, numbers in by_flips.items()}
    rows = tuple(
        (
            p["flips"],
            p["speed"],
            _fate(n),
            *(
                round(value, 3)
                for value in (
                    max(n["flipped"]),
                    n["flipped"][-1],
                    n["in_pressed"],
                    n["volume"],
                    n["extent"],
                )
            ),
        )
        for p, n in results.where()
    )
    columns = ("flips", "speed [m/s]", "fate", "most flipped [1]", "flipped at the end [1]",
               "of these where most was pressed [1]", "volume [1]", "largest extent [1]")  # fmt: skip
    return Section(
        (
            "The thesis's sphere, E = 1 MPa, hits the floor faster than after the fall of 7 m. At "
            f"{SPEED:g} m/s, with flips tolerated, it {said['tolerant']}; with flips off it "
            f"{said['off']}; with recovery it {said['recover']}.",
        ),
        (Finding("flips-dent", measured, verdict, why),),
        (Table("fates", "The sphere after the impact", columns, rows),),
        (
            Plot(
                "flips",
                "Share of tetrahedra that are inside out. A line that ends is a body that ran away.",
                lambda figure: _draw(figure, by_flips),
            ),
        ),
        tuple(_pictures(by_flips)),
    )


def _listed(values: Iterable[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)


def _is_dented(numbers: Numbers) -> bool:
    """True if inverted tetrahedra stay inverted, and lie where the compression was largest."""
    return bool(numbers["flipped"][-1] > MANY and numbers["kept"] > STAYS and numbers["in_pressed"] > PLACED)


def _fate(numbers: Numbers) -> str:
    if numbers["frozen"] or numbers["extent"] > APART:
        return "runs away"
    return "ends dented" if numbers["flipped"][-1] > MANY else "ends whole"


def _draw(figure: Any, by_flips: dict[str, Numbers]) -> None:
    axes = figure.add_subplot()
    for name, numbers in by_flips.items():
        axes.plot(numbers["time"], numbers["flipped"], label=name)
        if numbers["frozen"]:
            axes.plot(numbers["time"][-1], numbers["flipped"][-1], "x", color="black")
    axes.set_xscale("log")
    axes.set_xlim(left=0.005)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("tetrahedra inside out [1]")
    axes.legend(title="flips")


def _pictures(by_flips: dict[str, Numbers]) -> list[Picture]:
    from lab.experiments.pictures import picture

    mesh = load_mesh(ASSETS / "sphere.npz")
    poses = []
    for place, flips in enumerate(("tolerant", "recover")):
        x = np.array(by_flips[flips]["pose"])
        x[:, :2] += (3.0 * place, 0.0) - x[:, :2].mean(axis=0)
        x[:, 2] -= x[:, 2].min()
        poses.append((mesh, x))
    caption = (
        "Left the sphere with its dent (tolerant), right the one driven back (recover), set down beside it."
    )
    return [Picture("dents", caption, picture(poses, True))]


FLIPS_DENT = Experiment(
    "flips-dent",
    "Flipped tetrahedra make dents",
    "section 6.6",
    ("flips-dent",),
    points,
    measure,
    conclude,
)
