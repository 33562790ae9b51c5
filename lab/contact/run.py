"""Run a scene of contact and judge its criteria."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from lab.contact.scene import Scene
from taichi_soft import TaichiSoftError

DT = 1.0 / 60.0
"""Length of a step [s]."""


@dataclass(frozen=True)
class Outcome:
    """The result of one criterion of a scene, or the error that ended the scene."""

    scene: str
    title: str
    criterion: str
    measured: str
    wanted: str
    is_met: bool
    step_ms: float  # median time of a step [ms]


def run_scene(scene: Scene, on_step: Callable[[float], None] | None = None) -> list[Outcome]:
    """Run a scene. Returns: one outcome for each criterion.

    Args: on_step: called after each step with the fraction of the scene that is done.
    """
    times: list[float] = []
    try:
        stage = scene.make()
        if not stage.world.is_built:
            stage.world.build()
        count = max(1, round(scene.seconds / DT))
        for number in range(count):
            if stage.before_step is not None:
                stage.before_step(number * DT)
            begin = perf_counter()
            stage.world.step(DT)
            times.append(perf_counter() - begin)
            for criterion in stage.criteria:
                criterion.measure((number + 1) * DT)
            if on_step is not None:
                on_step((number + 1) / count)
        found = [(each.name, *each.result(), each.wanted) for each in stage.criteria]
    except TaichiSoftError as error:
        found = [("runs", str(error), False, "no error")]
    cost = 1e3 * float(np.median(times)) if times else float("nan")
    return [
        Outcome(scene.name, scene.title, name, measured, wanted, is_met, cost)
        for name, measured, is_met, wanted in found
    ]
