"""Cameras that move during a film: around a point or with a body."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.checks import as_number
from taichi_soft.core.errors import OptionError
from taichi_soft.render.camera import Camera
from taichi_soft.world.body import Body

BoxOf = Callable[[Body], NDArray[np.float64]]
"""Function that returns the bounding box of a body as it is drawn, (2, 3) [m]."""

LOOSE = 0.35
"""Largest distance between a followed body and the image's centre, as a fraction of half the shorter side."""


@dataclass(frozen=True)
class Orbit:
    """A camera that orbits the vertical axis through its target, at constant height and distance.

    Args:
        view: the camera at world time 0.
        period: world time of one turn [s], counterclockwise seen from above; negative for clockwise.
    Raises: OptionError for a period that is 0 or not finite.
    """

    view: Camera
    period: float = 20.0

    def __post_init__(self) -> None:
        _check_view(self.view)
        if not math.isfinite(as_number(self.period, "period", -1e6, 1e6)) or self.period == 0.0:
            raise OptionError(f"period must be finite and not 0, got {self.period!r}")

    def at(self, time: float, box_of: BoxOf) -> Camera:
        """Return the camera at a time.

        Args:
            time: world time [s].
            box_of: ignored.
        """
        angle = 2.0 * math.pi * time / self.period
        c, s = math.cos(angle), math.sin(angle)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        target = np.array(self.view.target)
        eye = target + turn @ (np.array(self.view.eye) - target)
        up = turn @ np.array(self.view.up)
        return Camera(tuple(eye), self.view.target, tuple(up), self.view.fov_degrees)


class Follow:
    """A camera that follows a body and keeps its direction.

    The movement is smoothed, but the centre of the body stays within about a third of the distance from the
    image's centre to the nearer edge. The smoothing assumes that the times passed to `at` ascend.

    Args:
        body: body to follow. It must be an actor of the stage.
        view: camera whose direction, distance and field of view are used. Its target is ignored.
        lag: time constant of the smoothing [s of world time], 0 to 10.
    Raises: OptionError for numbers out of range.
    """

    def __init__(self, body: Body, view: Camera, *, lag: float = 0.15) -> None:
        _check_view(view)
        if not isinstance(body, Body):
            raise OptionError(f"body must be a Body, got {type(body).__name__}")
        self.body, self.view = body, view
        self.lag = as_number(lag, "lag", 0.0, 10.0)
        self._time = math.inf
        self._target = np.zeros(3)

    def at(self, time: float, box_of: BoxOf) -> Camera:
        """Return the camera at a time. If the time is earlier than in the last call, the smoothing restarts.

        Args:
            time: world time [s].
            box_of: function that returns the bounding box of a body as it is drawn, (2, 3) [m].
        """
        middle = np.asarray(box_of(self.body)).mean(axis=0)
        passed = time - self._time
        if passed < 0.0:
            self._target = middle
        else:
            kept = math.exp(-passed / self.lag) if self.lag > 0.0 else 0.0
            behind = kept * (self._target - middle)
            reach = LOOSE * self.view.distance * math.tan(math.radians(self.view.fov_degrees) / 2.0)
            self._target = middle + behind * min(1.0, reach / max(float(np.linalg.norm(behind)), 1e-12))
        self._time = time
        x, y, z = (self._target + np.subtract(self.view.eye, self.view.target)).tolist()
        a, b, c = self._target.tolist()
        return Camera((x, y, z), (a, b, c), self.view.up, self.view.fov_degrees)


def _check_view(view: Camera) -> None:
    if not isinstance(view, Camera):
        raise OptionError(f"view must be a Camera, got {type(view).__name__}")
