"""Move the camera of a stage so that it sees all bodies during the whole run."""

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
"""Size of the view relative to the box of the bodies."""

DIRECTIONS = 72
"""Number of directions from which an orbiting camera must see all bodies."""


def framed(
    make_stage: Callable[[], Stage],
    *,
    aspect: float = 16 / 9,
    seconds: float | None = None,
    orbit: float | None = None,
) -> Stage:
    """Make a stage whose camera sees all bodies during the whole run. The direction of view is kept.

    `make_stage` is called twice. The first stage is run to its end, including its `act`. The second stage is
    returned in its initial state.
    Args:
        make_stage: function that returns the same stage at each call.
        aspect: width divided by height of the image.
        seconds: world time to run [s]; None uses the stage's default.
        orbit: period of an orbiting camera [s of world time], see `Orbit`; None for a fixed camera.
    Raises: OptionError for a moving camera or numbers out of range, before the run; and the errors of the
        stage's steps.
    """
    width = as_number(aspect, "aspect", 0.05, 20.0)
    if orbit is not None:
        Orbit(Camera((1.0, 0.0, 0.0)), orbit)  # raises an error for a wrong period
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
    """Raise an error, because an `Orbit` never needs the box of a body."""
    raise AssertionError(body)


def _box_of_run(stage: Stage, seconds: float | None) -> tuple[Floats, Floats]:
    """Run the stage. Returns: lower and upper corner of the box that contains its bodies during the whole run
    [m].
    """
    if not isinstance(stage.camera, Camera):
        raise OptionError(f"stage.camera must be a fixed Camera, got {type(stage.camera).__name__}")
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
