"""Grab and drag soft bodies with the mouse."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from panda3d import core

from taichi_soft import Body, Grab, OptionError, World

Floats = NDArray[np.float64]

_GRAZING = 1e-3
"""Smallest cosine of the angle between a ray and the normal of the drag plane. Rays at a larger angle are
ignored, because they hit the plane too far away."""


class MouseGrab:
    """Grabs the body under the mouse while a button is down.

    The grabbed point follows the mouse in a plane parallel to the screen.

    Args:
        base: the game's ShowBase.
        world: a built world.
        button: event of the mouse button. None if the game calls `press`, `move` and `release` itself.
        bodies: bodies that can be grabbed; None for all.
        frequency, max_force: strength of the grab, see `World.grab`.
        sort: Panda3D's sort value of the task that follows the mouse. The task must run before the task that
            steps the world.
    Raises: OptionError if `world` is not a World.
    """

    def __init__(
        self,
        base: Any,
        world: World,
        *,
        button: str | None = "mouse1",
        bodies: Iterable[Body] | None = None,
        frequency: float = 5.0,
        max_force: float | None = None,
        sort: int = 5,
    ) -> None:
        if not isinstance(world, World):
            raise OptionError(f"world must be a taichi_soft.World, got {type(world).__name__}")
        self._base, self._world = base, world
        self._bodies = None if bodies is None else tuple(bodies)
        self._frequency, self._max_force = frequency, max_force
        self._grab: Grab | None = None
        self._plane = (np.zeros(3), np.zeros(3))  # drag plane: a point [m] and the normal
        if button is not None:
            base.accept(button, self._press_at_mouse)
            base.accept(f"{button}-up", self.release)
            base.task_mgr.add(self._follow, "soft body mouse", sort=sort)

    @property
    def grab(self) -> Grab | None:
        """Current grab; None without a grab, or after its body was removed."""
        if self._grab is not None and not self._grab.is_held:
            self._grab = None
        return self._grab

    def press(self, x: float, y: float) -> bool:
        """Grab the body that is visible at a point of the window.

        Args:
            x, y: point of the window, from (-1, -1) at the lower left to (1, 1) at the upper right.
        Returns: True if a body was hit.
        Raises: as `World.grab`.
        """
        self.release()
        near, far = self.ray(x, y)
        self._grab = self._world.grab(
            near,
            far - near,
            max_distance=float(np.linalg.norm(far - near)),
            bodies=self._bodies,
            frequency=self._frequency,
            max_force=self._max_force,
        )
        if self._grab is not None:
            forward = self._base.render.get_relative_vector(self._base.cam, core.LVector3.forward())
            self._plane = self._grab.point, np.array(forward, dtype=np.float64)
        return self._grab is not None

    def move(self, x: float, y: float) -> None:
        """Move the target of the grab to the drag plane, on the ray through a point of the window.

        If the ray misses the plane, the target does not move.
        Args:
            x, y: point of the window, from (-1, -1) at the lower left to (1, 1) at the upper right.
        """
        if self.grab is None:
            return
        near, far = self.ray(x, y)
        point, normal = self._plane
        along = (far - near) / np.linalg.norm(far - near)
        closing = float(along @ normal)
        if abs(closing) > _GRAZING and (distance := float((point - near) @ normal) / closing) > 0.0:
            self.grab.move(near + distance * along)

    def release(self) -> None:
        """Release the current grab, if there is one."""
        if self.grab is not None:
            self.grab.release()
        self._grab = None

    def ray(self, x: float, y: float) -> tuple[Floats, Floats]:
        """Return the start and the end of the ray through a point of the window, within the lens's range,
        (3,) [m] each.

        Args:
            x, y: point of the window, from (-1, -1) at the lower left to (1, 1) at the upper right.
        Raises: OptionError if the camera's lens has no ray there.
        """
        ends = core.LPoint3(), core.LPoint3()
        if not self._base.camLens.extrude(core.LPoint2(x, y), *ends):
            raise OptionError(f"the camera's lens has no line of sight at ({x}, {y})")
        near, far = (self._base.render.get_relative_point(self._base.cam, end) for end in ends)
        return np.array(near, dtype=np.float64), np.array(far, dtype=np.float64)

    def _press_at_mouse(self) -> None:
        watcher = self._base.mouseWatcherNode
        if watcher is not None and watcher.has_mouse():
            self.press(watcher.get_mouse_x(), watcher.get_mouse_y())

    def _follow(self, task: Any) -> Any:
        watcher = self._base.mouseWatcherNode
        if watcher is not None and watcher.has_mouse():
            self.move(watcher.get_mouse_x(), watcher.get_mouse_y())
        return task.cont
