"""A stage whose camera sees all of where its bodies go."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.checks import LARGEST_COUNT, as_number, as_positive
from taichi_soft.core.errors import OptionError
from taichi_soft.render.camera import Camera
from taichi_soft.render.props import Scenery
from taichi_soft.render.stage import Stage
from taichi_soft.render.take import Take

Floats = NDArray[np.float64]

MARGIN = 1.06
"""Room round the bodies."""


def framed(make_stage: Callable[[], Stage], *, aspect: float = 16 / 9, seconds: float | None = None) -> Stage:
    """A stage, its camera moved along its line of sight until it sees all places to which bodies come.

    The stage is made twice: one is run to its end, in which its script may keep what it likes; the other is
    returned as it begins.
    Args:
        make_stage: makes the same stage whenever it is called.
        aspect: width over height of the picture.
        seconds: of the world that are looked at [s]; None takes the stage's own.
    Raises: OptionError for a stage whose camera moves by itself or numbers out of range, before anything
        moves; and what the stage's steps raise.
    """
    width = as_number(aspect, "aspect", 0.05, 20.0)
    low, high = _box_of_run(make_stage(), seconds)
    stage = make_stage()
    assert isinstance(stage.camera, Camera)
    stage.camera = stage.camera.seeing(low, high, aspect=width, margin=MARGIN)
    return stage


def _box_of_run(stage: Stage, seconds: float | None) -> tuple[Floats, Floats]:
    """Lower and upper corner of all places of its bodies [m]."""
    if not isinstance(stage.camera, Camera):
        raise OptionError(f"the camera moves by itself: {type(stage.camera).__name__}")
    length = as_positive(stage.seconds if seconds is None else seconds, "seconds", "s")
    steps = length / stage.step.dt
    if steps > LARGEST_COUNT:
        raise OptionError(f"seconds is {length:g}: at most {LARGEST_COUNT:,} steps of {stage.step.dt:g} s")
    take = Take(stage, Scenery(stage.world))
    take.play(0.0)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for _ in range(max(1, round(steps))):
        for rows in take.positions:
            low, high = np.minimum(low, rows.min(axis=0)), np.maximum(high, rows.max(axis=0))
        take.play(stage.step.dt)
    return low, high
