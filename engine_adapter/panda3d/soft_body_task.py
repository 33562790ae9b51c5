"""Task that steps a world with Panda3D's clock and draws it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol

from panda3d import core

from engine_adapter.adapter import EngineAdapter
from taichi_soft import OptionError


class Drawn(Protocol):
    """Node that is drawn each frame, such as a `SoftBodyNode` or a `DebugNode`."""

    def draw(self) -> None:
        """Update the node."""


class SoftBodyTask:
    """Advances a world once per frame and then draws its nodes.

        task = SoftBodyTask(base, adapter, [SoftBodyNode(adapter, body)])

    The frame time comes from Panda3D's global clock. For reproducible frames, set the clock's mode to
    `M_non_real_time`.

    Args:
        base: the game's ShowBase.
        adapter: adapter that steps the world.
        nodes: nodes to draw, in this order.
        sort: sort value of the task, see `task_mgr.add`. Panda3D's rendering task has the value 50.
    Raises: OptionError if `adapter` is not an EngineAdapter.

    Attributes:
        nodes: list of the nodes to draw. You can append to it and remove from it.
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
        """Remove the task, so that it no longer steps the world."""
        self._base.task_mgr.remove(self._task)

    def _run(self, task: Any) -> Any:
        self._adapter.advance(core.ClockObject.get_global_clock().dt)
        for node in self.nodes:
            node.draw()
        return task.cont
