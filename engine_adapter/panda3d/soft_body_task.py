"""A task that drives a world by Panda3D's clock and draws it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol

from panda3d import core

from engine_adapter.adapter import EngineAdapter
from taichi_soft import OptionError


class Drawn(Protocol):
    """What is drawn each frame: a `SoftBodyNode`, a `DebugNode`."""

    def draw(self) -> None:
        """Bring it up to date."""


class SoftBodyTask:
    """Lets time go on in a world, once a frame, and then draws its nodes.

        task = SoftBodyTask(base, adapter, [SoftBodyNode(adapter, body)])

    The time of a frame is that of Panda3D's global clock. For pictures that come out the same every time set
    the clock's mode to `M_non_real_time`.

    Args:
        base: the game's ShowBase.
        adapter: that steps the world.
        nodes: to draw, in this order.
        sort: of the task, as `task_mgr.add` takes it. Panda3D draws the frame at 50.
    Raises: OptionError for what is no adapter.

    Attributes:
        nodes: the list of what is drawn: append to it and remove from it.
    """

    def __init__(
        self, base: Any, adapter: EngineAdapter, nodes: Iterable[Drawn] = (), *, sort: int = 10
    ) -> None:
        if not isinstance(adapter, EngineAdapter):
            raise OptionError(f"adapter must be an EngineAdapter, got {type(adapter).__name__}")
        self.nodes: list[Drawn] = list(nodes)
        self._base, self._adapter = base, adapter
        self._task = base.task_mgr.add(self._run, "soft bodies", sort=sort)

    def remove(self) -> None:
        """Take the task out of the game: time stands still in the world."""
        self._base.task_mgr.remove(self._task)

    def _run(self, task: Any) -> Any:
        self._adapter.advance(core.ClockObject.get_global_clock().dt)
        for node in self.nodes:
            node.draw()
        return task.cont
