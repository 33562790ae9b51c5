"""What implicit Euler gains for the CMPM (thesis section 4.2): length of a step, and rate of the simulation.

A stiff sphere falls onto the floor, once with leapfrog and its largest step, and with implicit Euler.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lab.experiments.cmpm_drop import (
    BOUNCE,
    FRAME,
    FRAMES,
    HEIGHT,
    MATERIAL,
    RADIUS,
    Drop,
    bounces,
    fall,
    is_whole,
    rebound,
)
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
from lab.experiments.timing import in_turns

THESIS_GAIN = 100.0
"""How much longer a step the thesis takes: 1e-2 s instead of 1e-4 s."""

THESIS_RATES = (20.0, 30.0)
RATE_TOLERANCE = 1.5
"""Factor about them within which a rate agrees: processors differ in what a linear solve costs."""

EXPLICIT, IMPLICIT = (0.9, 1.3), (10.0, THESIS_GAIN, 300.0)
"""Steps that are run, over leapfrog's largest stable one."""


def points(effort: Effort) -> list[Point]:
    """Falls with several steps, and the time that both take in turns."""
    resolution, repeats = (3, 2) if effort is Effort.QUICK else (5, 5)
    falls = [("leapfrog", factor) for factor in EXPLICIT] + [
        ("implicit_euler", factor) for factor in IMPLICIT
    ]
    common = {"resolution": resolution}
    return [
        *({**common, "run": "fall", "integrator": name, "factor": factor} for name, factor in falls),
        {**common, "run": "rates", "integrator": "both", "factor": THESIS_GAIN, "repeats": repeats},
    ]


def measure(point: Point) -> Numbers:
    """Height and volume frame by frame; or the least seconds that each frame takes with both integrators."""
    if point["run"] == "fall":
        return fall(Drop(point["integrator"], point["factor"], point["resolution"]))
    slow, fast = np.array([_in_turns(point) for _ in range(point["repeats"])]).min(axis=0)
    return {"explicit": slow.tolist(), "implicit": fast.tolist()}


def _in_turns(point: Point) -> tuple[list[float], list[float]]:
    """Times of all frames [s]. The worlds end with the call: later ones compile nothing."""
    explicit = Drop("leapfrog", EXPLICIT[0], point["resolution"])
    implicit = Drop("implicit_euler", point["factor"], point["resolution"])
    return in_turns(explicit.frame, implicit.frame, FRAMES)


def _keeps(is_kept: bool) -> str:
    return "keeps the sphere whole" if is_kept else "does not keep the sphere whole"


def _up_to(step: float) -> str:
    return (
        f"with implicit steps of up to {1e3 * step:.3g} ms" if step else "with no implicit step that was run"
    )


def conclude(results: Results) -> Section:
    """Which steps are sound, and seconds over seconds."""
    falls = {
        (name, factor): results.one(run="fall", integrator=name, factor=factor)
        for name, factors in (("leapfrog", EXPLICIT), ("implicit_euler", IMPLICIT))
        for factor in factors
    }
    rates = results.one(run="rates")
    gain = sum(rates["explicit"]) / sum(rates["implicit"])
    reference = falls["leapfrog", EXPLICIT[0]]["height"]
    whole = {key: is_whole(numbers, reference) for key, numbers in falls.items()}
    sound = {key: whole[key] and bounces(numbers, reference) for key, numbers in falls.items()}
    thesis_like = falls["implicit_euler", THESIS_GAIN]
    limit = thesis_like["limit"]
    steps_hold = (
        whole["leapfrog", EXPLICIT[0]]
        and not whole["leapfrog", EXPLICIT[1]]
        and whole["implicit_euler", THESIS_GAIN]
    )
    low, high = THESIS_RATES[0] / RATE_TOLERANCE, THESIS_RATES[1] * RATE_TOLERANCE
    rebounds = {key: rebound(numbers["height"]) for key, numbers in falls.items()}
    longest, longest_sound = (
        max((n["step"] for key, n in falls.items() if key[0] != "leapfrog" and held[key]), default=0.0)
        for held in (whole, sound)
    )
    findings = (
        judged_but_for(
            "implicit-step",
            f"leapfrog is stable up to {1e3 * limit:.3g} ms (run with {EXPLICIT[0]} of it the sphere "
            f"{'holds' if whole['leapfrog', EXPLICIT[0]] else 'breaks'}, with {EXPLICIT[1]} it "
            f"{'holds' if whole['leapfrog', EXPLICIT[1]] else 'breaks'}); implicit Euler with "
            f"{1e3 * thesis_like['step']:.3g} ms {_keeps(whole['implicit_euler', THESIS_GAIN])}, up to "
            f"{1e3 * longest:.3g} ms did. Bounce: {rebounds['leapfrog', EXPLICIT[0]]:.2f} m with leapfrog, "
            f"{rebounds['implicit_euler', THESIS_GAIN]:.2f} m with that step",
            steps_hold,
            "the material is so stiff that leapfrog needs the thesis's 1e-4 s; the table shows which "
            "condition fails: a fall off course, a flipped or frozen body, or a leapfrog stable beyond "
            "its limit",
            [] if sound["implicit_euler", THESIS_GAIN] else ["the bounce"],
            "implicit Euler damps what is faster than its step, and an impact is. The thesis does not tell "
            f"what its body did. At least {BOUNCE:g} of the bounce was kept {_up_to(longest_sound)}",
        ),
        Finding(
            "implicit-rate",
            f"a second of simulation takes {sum(rates['explicit']) / FRAME / FRAMES:.3g} s with leapfrog and "
            f"{sum(rates['implicit']) / FRAME / FRAMES:.3g} s with implicit Euler and a step "
            f"{THESIS_GAIN:.0f} "
            f"times as long: {gain:.3g} times faster, on this machine",
            Verdict.AGREES if low < gain < high else Verdict.DIFFERS,
            ""
            if low < gain < high
            else "the gain is the ratio of the steps over what a solve costs beside a substep, "
            f"{THESIS_GAIN / EXPLICIT[0] / gain:.3g} here: this depends on body, tolerance and processor",
        ),
    )

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        time = FRAME * np.arange(FRAMES + 1)
        for (name, factor), numbers in falls.items():
            if (name, factor) == ("leapfrog", EXPLICIT[1]):
                continue
            label = f"{name}, {1e3 * numbers['step']:.3g} ms"
            axes.plot(time, [HEIGHT, *numbers["height"]], "o-", markersize=3, label=label)
        axes.axhline(RADIUS, color="grey", linestyle=":", label="radius of the sphere")
        axes.set_xlabel("time [s]")
        axes.set_ylabel("height of the centre [m]")
        axes.legend(fontsize="small")

    return Section(
        (
            f"A CMPM sphere of E = {float(np.max(MATERIAL.young)):.0g} Pa, so stiff that leapfrog needs "
            f"steps of {limit:.1g} s (the thesis: 1e-4 s, of a body that it does not name), falls half a "
            "metre. With implicit Euler the step may be as long as one likes; a hundredfold step follows the "
            "fall and brings the sphere to rest whole. What is lost is the bounce. A fall is called sound if "
            f"it keeps {BOUNCE:g} of it or more.",
        ),
        findings,
        (
            Table(
                "falls",
                "The fall with several steps",
                (
                    "integrator",
                    "step [ms]",
                    "over leapfrog's limit [1]",
                    "least volume [1]",
                    "flipped",
                    "frozen",
                    "rebound [m]",
                    "whole",
                    "sound",
                ),
                tuple(
                    (
                        name,
                        f"{1e3 * n['step']:.3g}",
                        f"{n['step'] / n['limit']:.3g}",
                        round(n["least_volume"], 4),
                        n["flipped"],
                        n["frozen"],
                        f"{rebounds[name, factor]:.2f}" if whole[name, factor] else "-",
                        whole[name, factor],
                        sound[name, factor],
                    )
                    for (name, factor), n in falls.items()
                ),
            ),
        ),
        (
            Plot(
                "falls",
                "Height of the sphere: long implicit steps follow the fall, but not the bounce.",
                draw,
            ),
        ),
    )


IMPLICIT_STEP = Experiment(
    "implicit-step",
    "Steps of implicit Euler",
    "section 4.2",
    ("implicit-step", "implicit-rate"),
    points,
    measure,
    conclude,
    is_timing=True,
)
