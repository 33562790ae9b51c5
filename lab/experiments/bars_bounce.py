"""A complex object of bars bounces (thesis figure 6.2): its bars bend on impact and vibrate after lift-off.

Three crossed bars fall onto three of their six ends. Bending is measured relative to the crossing. The energy
of the vibration is the kinetic energy minus that of a rigid body with the same momentum and angular momentum.
"""

from __future__ import annotations

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
from taichi_soft import Body, Material, TetMesh, load_mesh
from taichi_soft.core.package_data import ASSETS
from taichi_soft.world.bare import bare_world

Floats = NDArray[np.float64]

MATERIAL = Material(young=1e7, poisson=0.2, density=1000.0, damping=20.0, damping_ratio=0.0)
HALF, THICKNESS, DROP = 1.3, 0.2, 1.5  # half length and thickness of a bar, height of the drop [m]
DT, SUBSTEPS, SECONDS = 0.01, 24, 1.7
UPRIGHT = np.array([[1, -1, 0], [1, 1, -2], [1, 1, 1]]) / np.sqrt([[2], [6], [3]])
"""Rotation that turns the diagonal of the three bars upright."""
SEEN, BENT, VIBRATES = 0.05, 3.0, 0.01
"""A deflection is visible if it exceeds `SEEN` times the free length of a bar. Bars bend if the deflection is
visible and exceeds `BENT` times the change of length. Bars vibrate if the energy of the vibration in flight
exceeds `VIBRATES` times the energy of the impact."""


def points(effort: Effort) -> list[Point]:
    """List the points: one fall, and for a full report also the fall of a body half as stiff."""
    stiffnesses = (1.0,) if effort is Effort.QUICK else (1.0, 0.5)
    return [{"stiffness": share} for share in stiffnesses]


def bars_mesh() -> TetMesh:
    """Return the mesh of the bars. They cross at the origin, and end at +-1.3 m on each axis."""
    mesh = load_mesh(ASSETS / "bars.npz")
    return mesh.translated(-np.mean(mesh.bounds, axis=0))


def measure(point: Point) -> Numbers:
    """Measure deflections, lengths and energies at 100 Hz, and store four poses."""
    mesh = bars_mesh()
    world = bare_world(retries=0)
    material = Material(MATERIAL.young * point["stiffness"], 0.2, 1000.0, 20.0, damping_ratio=0.0)
    low = float((mesh.vertices @ UPRIGHT.T)[:, 2].min())
    body = world.add_body(mesh, material, rotation=UPRIGHT, position=(0, 0, DROP - low), law="virial")
    world.build()
    series: dict[str, list[float]] = {
        name: [] for name in ("time", "lowest", "center", "bend", "length", "kinetic", "vibration")
    }
    frames = []
    for _ in range(round(SECONDS / DT)):
        world.step(DT, SUBSTEPS)
        x = body.positions().astype(np.float64)
        bend, length = bending(mesh, x)
        values = (world.time, x[:, 2].min(), body.center_of_mass()[2], bend, length)
        for name, value in zip(series, (*values, *energies(body)), strict=True):
            series[name].append(float(value))
        frames.append(np.round(x, 3))
    begin, lift, end = flight_of(series)
    chosen = (begin - 1, begin + int(np.argmax(series["bend"][begin:lift])), lift, (lift + end) // 2)
    return {
        **series,
        "poses": [frames[i].tolist() for i in chosen],
        "moments": [(i + 1) * DT for i in chosen],
    }


def bending(mesh: TetMesh, x: Floats) -> tuple[float, float]:
    """Return the largest deflection of an end across its bar [m], and the largest relative change of length.

    Deflections are measured in axes that move and rotate with the crossing. Lengths are measured from the
    crossing to each end, along the centres of the cross-sections.
    """
    rest = mesh.vertices
    hub = (np.abs(rest) < 0.6 * THICKNESS).all(axis=1)
    left, _, right = np.linalg.svd((rest[hub] - rest[hub].mean(axis=0)).T @ (x[hub] - x[hub].mean(axis=0)))
    turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    seen = (x - x[hub].mean(axis=0)) @ turn.T
    deflection, change = 0.0, 0.0
    stations = np.arange(0.1, HALF + 1e-6, 0.1)
    for axis in range(3):
        for side in (-1.0, 1.0):
            in_arm = (np.abs(np.delete(rest, axis, axis=1)) < 0.6 * THICKNESS).all(axis=1)
            line = np.array(
                [seen[in_arm & (np.abs(side * rest[:, axis] - s) < 1e-6)].mean(axis=0) for s in stations]
            )
            deflection = max(deflection, float(np.linalg.norm(np.delete(line[-1], axis))))
            length = np.linalg.norm(np.diff(line, axis=0), axis=1).sum()
            change = max(change, abs(float(length / (stations[-1] - stations[0])) - 1.0))
    return deflection, change


def energies(body: Body) -> tuple[float, float]:
    """Return the kinetic energy, and the energy of the vibration [J].

    The energy of the vibration is the kinetic energy minus that of a rigid body with the same momentum and
    angular momentum.
    """
    masses, x, v = body.masses[:, None], body.positions().astype(np.float64), body.velocities().astype(float)
    total = masses.sum()
    x, mean = x - (masses * x).sum(axis=0) / total, (masses * v).sum(axis=0) / total
    spin = np.cross(x, masses * (v - mean)).sum(axis=0)
    inertia = (masses[:, 0] @ (x**2).sum(axis=1)) * np.eye(3) - (masses * x).T @ x
    rigid = 0.5 * total * mean @ mean + 0.5 * spin @ np.linalg.solve(inertia, spin)
    kinetic = float(0.5 * (masses * v**2).sum())
    return kinetic, kinetic - float(rigid)


def flight_of(series: Numbers) -> tuple[int, int, int]:
    """Return three indices of steps: the first contact, and the start and end of the longest later flight.

    The end is exclusive.
    """
    low = np.array(series["lowest"]) < 1e-3
    touched = int(np.argmax(low))
    best, start = (touched, touched), touched
    for i in range(touched, len(low) + 1):
        if i == len(low) or low[i]:
            if i - start > best[1] - best[0]:
                best = (start, i)
            start = i + 1
    return touched, *best


def frequency_of(energy: list[float]) -> float:
    """Return the strongest frequency of a vibration [Hz], given the kinetic energy in each step.

    The kinetic energy oscillates at twice this frequency.
    """
    if len(energy) < 4:
        return 0.0
    spectrum = np.abs(np.fft.rfft(np.array(energy) - np.mean(energy), 4096))
    return float(0.5 * np.argmax(spectrum) / (4096 * DT))


def conclude(results: Results) -> Section:
    """Judge the bending on the floor and the vibration in flight."""
    numbers = results.one(stiffness=1.0)
    begin, lift, end = flight_of(numbers)
    impact = numbers["kinetic"][begin - 1]
    worst = int(np.argmax(numbers["bend"][begin:lift])) + begin if lift > begin else begin
    bend, change = numbers["bend"][worst] / HALF, numbers["length"][worst]
    flying = numbers["vibration"][lift:end]
    frequency = frequency_of(flying)
    swings = frequency * DT * (end - lift)
    vibration = max(flying, default=0.0) / impact
    bends = bend > SEEN and bend > BENT * change
    vibrates = swings >= 1.0 and vibration > VIBRATES
    measured = (
        f"on the floor ends deflect by up to {bend:.2f} of their bar's free length while that changes by "
        f"{100 * change:.0f} %; in a flight of {DT * (end - lift):.2f} s up to {100 * vibration:.0f} % of "
        f"the energy of the impact swings at {frequency:.1f} Hz"
    )
    why = ""
    if not (bends and vibrates):
        why = "the model: " + ("bars do not bend" if not bends else "they do not vibrate in flight")
    rows = tuple(
        (
            p["stiffness"] * MATERIAL.young,
            round(max(n["bend"]), 3),
            round(DT * (float(np.subtract(*flight_of(n)[:0:-1]))), 2),
        )
        for p, n in results.where()
    )
    return Section(
        ("Three crossed bars of 2.6 m, 0.2 m thick, fall by 1.5 m onto three of their ends.",),
        (Finding("bars-bounce", measured, Verdict.AGREES if bends and vibrates else Verdict.DIFFERS, why),),
        (
            Table(
                "bars",
                "Bending and flight",
                ("E [Pa]", "largest deflection [m]", "longest flight [s]"),
                rows,
            ),
        ),
        (
            Plot(
                "bars",
                "Height, bending and vibration; grey: in flight after the bounce. The vibration goes on "
                "there.",
                lambda figure: _draw(figure, numbers),
                (6.4, 6.0),
            ),
        ),
        tuple(_pictures(numbers)),
    )


def _draw(figure: Any, numbers: Numbers) -> None:
    _, lift, end = flight_of(numbers)
    panels = figure.subplots(3, 1, sharex=True)
    time = np.array(numbers["time"])
    panels[0].plot(time, numbers["center"], label="centre of mass")
    panels[0].plot(time, numbers["lowest"], label="lowest vertex")
    panels[0].set_ylabel("height [m]")
    panels[0].legend()
    panels[1].plot(time, numbers["bend"])
    panels[1].set_ylabel("largest deflection\nof an end [m]")
    panels[2].plot(time, numbers["vibration"])
    panels[2].set_ylabel("kinetic energy of\nvibration [J]")
    panels[2].set_xlabel("time [s]")
    for axes in panels:
        axes.axvspan(time[lift], time[end - 1], color="0.9")


def _pictures(numbers: Numbers) -> list[Picture]:
    from lab.experiments.pictures import picture

    mesh = bars_mesh()
    said = ("just before the impact", "bent most", "at lift-off", "in flight")
    return [
        Picture(f"bars-{i}", f"{words}, t = {moment:.2f} s", picture([(mesh, np.array(pose))], True))
        for i, (words, moment, pose) in enumerate(
            zip(said, numbers["moments"], numbers["poses"], strict=True), start=1
        )
    ]


BARS_BOUNCE = Experiment(
    "fig-6.2",
    "Bars that bend and ring",
    "figure 6.2",
    ("bars-bounce",),
    points,
    measure,
    conclude,
)
