"""A stage whose camera sees all places to which its bodies come."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.checks import LARGEST_COUNT, as_number, as_positive
from taichi_soft.core.errors import OptionError
from taichi_soft.render.camera import Camera
from taichi_soft.render.camera_moves import Orbit
from taichi_soft.render.props import Scenery
from taichi_soft.render.stage import Stage
from taichi_soft.render.take import Take
from taichi_soft.world.body import Body

Floats = NDArray[np.float64]

MARGIN = 1.06
"""Room round the bodies."""

DIRECTIONS = 72
"""From which a camera that goes round has to see all of them."""


def framed(
    make_stage: Callable[[], Stage],
    *,
    aspect: float = 16 / 9,
    seconds: float | None = None,
    orbit: float | None = None,
) -> Stage:
    """A stage, its camera moved along its line of sight until it sees all places to which bodies come.

    The stage is made twice: one is run to its end, in which its script may keep what it likes; the other is
    returned as it begins.
    Args:
        make_stage: makes the same stage whenever it is called.
        aspect: width over height of the picture.
        seconds: of the world that are looked at [s]; None takes the stage's own.
        orbit: period of a camera that goes round the bodies [s of the world], as `Orbit` takes it; None for
            one that stays.
    Raises: OptionError for a stage whose camera moves by itself or numbers out of range, before anything
        moves; and what the stage's steps raise.
    """
    width = as_number(aspect, "aspect", 0.05, 20.0)
    if orbit is not None:
        Orbit(Camera((1.0, 0.0, 0.0)), orbit)  # refuses a wrong period now
    low, high = _box_of_run(make_stage(), seconds)
    stage = make_stage()
    assert isinstance(stage.camera, Camera)
    view = stage.camera.seeing(low, high, aspect=width, margin=MARGIN)
    if orbit is None:
        stage.camera = view
        return stage
    turn = Orbit(view, 1.0)
    sides = [turn.at(i / DIRECTIONS, _no_box) for i in range(DIRECTIONS)]
    farthest = max(side.seeing(low, high, aspect=width, margin=MARGIN).distance for side in sides)
    eye = view.target + np.subtract(view.eye, view.target) * (farthest / view.distance)
    stage.camera = Orbit(replace(view, eye=tuple(eye)), orbit)
    return stage


def _no_box(body: Body) -> Floats:
    """For a camera that follows nothing."""
    raise AssertionError(body)


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
