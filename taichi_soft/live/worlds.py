"""Manage the worlds that are shown or being prepared, each in its own process."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from taichi_soft.live.audience import Audience
from taichi_soft.live.controls import Given
from taichi_soft.live.inbox import SERVER
from taichi_soft.live.pane import Runner
from taichi_soft.live.scene import SceneSource

MOST_BREAKDOWNS = 2
"""Largest number of failures within a minute after which a shown world is restarted. After one more failure,
the world is closed."""

USUAL_KERNELS = 70
"""Approximate number of kernels that a world compiles."""

_log = logging.getLogger("taichi_soft")

OnFile = Callable[[Runner, tuple[Any, ...]], None]


class Worlds:
    """One or two shown worlds, side by side, and the worlds that will replace them.

    Args:
        source: source of the first world.
        folder: folder for files that processes share.
        audience: visitors that receive status messages.
        on_file: called with a world and its message "saved" or "filmed".
        is_attached: True if another program steps the world.
    """

    def __init__(
        self, source: SceneSource, folder: Path, audience: Audience, on_file: OnFile, *, is_attached: bool
    ) -> None:
        self._source, self._folder, self._audience = source, folder, audience
        self._on_file, self._is_attached = on_file, is_attached
        self.panes: dict[int, Runner] = {}  # shown worlds, by pane
        self.coming: dict[int, Runner] = {}  # worlds being prepared, by pane
        self.paused = False
        self.tint: str | None = None  # quantity that colours the bodies
        self._count = 0
        self._failures: list[float] = []  # times of failures [s]

    def attach(self, connection: Connection) -> None:
        """Show a world that another program steps."""
        loop = asyncio.get_running_loop()
        self.panes[0] = Runner(loop, connection, self._source, self._heard_of(0))

    def begin(
        self, pane: int, source: SceneSource, *, is_fresh: bool = False, given: Given | None = None
    ) -> None:
        """Prepare a world for a pane. The shown world continues until the new world is ready.

        Args:
            is_fresh: True to start in the initial state instead of the shown world's state.
            given: slider values; None uses the slider values of the shown world.
        """
        if pane in self.coming:
            self.coming.pop(pane).kill()
        self._audience.set_trouble(None)
        self._count += 1
        folder = self._folder / str(self._count)
        loop, values = asyncio.get_running_loop(), self.given() if given is None else given
        runner = Runner.started(loop, folder, source, values, self._heard_of(pane))
        runner.is_fresh = is_fresh or self.restarts(pane)
        runner.keeps_sliders = given is not None
        self.coming[pane] = runner
        self._audience.show_activity(f"world {pane}", described(source), "starting")

    def given(self) -> Given:
        """Return the slider values that visitors chose in the first world."""
        state = self.panes[0].state if 0 in self.panes else None
        return Given() if state is None else Given(dict(state["given"]), state["preset"])

    def source(self, pane: int) -> SceneSource:
        """Return the source of a pane's world, or of the new world that is being prepared for the pane."""
        for runners in (self.coming, self.panes):
            if pane in runners:
                return runners[pane].source
        return self._source

    def add_mesh(self, path: str) -> None:
        """Prepare worlds with capacity for bodies of a mesh file."""
        for pane in sorted({0, *self.panes, *self.coming}):
            source = self.source(pane)
            self.begin(pane, replace(source, meshes=(*source.meshes, path)))

    def show_one(self) -> None:
        """End the second world."""
        for runners in (self.panes, self.coming):
            if 1 in runners:
                runners.pop(1).kill()  # a process does not read messages while it compiles
        self._audience.end_activity("world 1")
        self._audience.wake()

    def reset(self, sender: int = SERVER) -> None:
        """Reset all worlds.

        Scenes with their own code are restarted, because a snapshot does not contain the state
        of that code.
        """
        for pane, runner in list(self.panes.items()):
            if self.restarts(pane):
                self.begin(pane, runner.source, is_fresh=True, given=self.given().at_reset())
            else:
                runner.send("reset", sender=sender, key="reset")

    def restarts(self, pane: int) -> bool:
        """True if a reset restarts the world of a pane."""
        runner = self.panes.get(pane)
        return runner is not None and bool((runner.state or {}).get("restarts"))

    def leave(self, visitor: int) -> None:
        """Release the grab of a visitor who has left, and drop the visitor's waiting requests."""
        for runner in self.panes.values():
            runner.send("leave", visitor, sender=visitor)

    def runners(self) -> list[Runner]:
        """Return all worlds, shown or being prepared."""
        return [*self.panes.values(), *self.coming.values()]

    def _heard_of(self, pane: int) -> Callable[[Runner, tuple[Any, ...]], None]:
        return lambda runner, message: self.hear(pane, runner, message)

    def hear(self, pane: int, runner: Runner, message: tuple[Any, ...]) -> None:
        """Handle a message from a world."""
        name, *rest = message
        is_shown, is_coming = self.panes.get(pane) is runner, self.coming.get(pane) is runner
        if runner.is_over or not (is_shown or is_coming):
            return
        if name == "progress" and is_coming:
            self._show_progress(pane, runner, *rest)
        elif name == "ready":
            self._switch(pane, runner)
        elif name == "failed":
            self._fail(pane, runner, rest[0])
        elif name == "ended":
            self._fail(pane, runner, "its process ended")
        elif name == "said":
            self._audience.say(rest[0])
        elif name == "refused":
            self._audience.refuse(*rest)
        elif name == "motion" and is_shown and pane in self.coming and self.coming[pane].is_asked:
            self.coming[pane].send("take_motion", rest[0])
            self._show(pane, self.coming[pane])
        elif name in ("saved", "filmed"):
            self._on_file(runner, message)
        elif name in ("frame", "drawn", "state"):
            self._audience.wake()

    def _show_progress(self, pane: int, runner: Runner, step: str, kernels: int) -> None:
        about = 0
        if step == "building":
            names = [Path(each).name for each in runner.source.meshes]
            step = f"reading {', '.join(names)}, building bodies" if names else "building bodies"
        elif kernels < USUAL_KERNELS:
            about = USUAL_KERNELS
        self._audience.show_activity(f"world {pane}", described(runner.source), step, kernels, about)

    def _switch(self, pane: int, runner: Runner) -> None:
        """Show a world that is ready. The world continues the motion of the world that it replaces."""
        before = self.panes.get(pane)
        goes_on = before is not None and not before.is_lost and not runner.is_fresh
        if before is not None and goes_on and before.send("motion"):
            runner.is_asked = True
        elif pane == 1 and before is None and 0 in self.panes:
            self._show(pane, runner)
            self.reset()
            self._settle()
        else:
            self._show(pane, runner)

    def _show(self, pane: int, runner: Runner) -> None:
        before = self.panes.get(pane)
        given = self.given()
        self.panes[pane] = runner
        self.coming.pop(pane, None)
        if self.tint:
            runner.send("tint", self.tint)
        if before is not None:
            before.stop()
        if not runner.keeps_sliders and given != Given():
            runner.send("give", given)
        new = [mesh for mesh in runner.source.meshes if before is None or mesh not in before.source.meshes]
        for mesh in new:
            runner.send("spawn", Path(mesh).stem)
        self._settle(runner if before is None else None)
        runner.send("pause", self.paused)
        self._audience.end_activity(f"world {pane}")
        names = ", ".join(Path(mesh).stem for mesh in new)
        arrived = f": {names} was added, and its button adds more" if names else ""
        self._audience.say(f"{described(runner.source)} is ready{arrived}")
        self._audience.wake()

    def _settle(self, first: Runner | None = None) -> None:
        """Clear the histories of all worlds, so that an undo affects all worlds in the same way.

        Later resets of the world `first` restore its current state.
        """
        for runner in self.panes.values():
            runner.send("settle", runner is first)

    def _fail(self, pane: int, runner: Runner, words: str) -> None:
        """Drop a world that failed during preparation. Restart a world that failed while it was shown."""
        runner.stop()
        runner.is_lost = True
        if self.coming.get(pane) is runner:
            del self.coming[pane]
            self._audience.end_activity(f"world {pane}")
            words = f"{described(runner.source)}: {words}"
            self._audience.say(words)
            if not self.panes:
                self._audience.set_trouble(words)
                _log.warning("live: %s", words)
            return
        if pane in self.coming:  # the coming world replaces the failed world
            if self.coming[pane].is_asked:
                self._show(pane, self.coming[pane])
            return
        if self._is_attached:
            self._audience.set_trouble("the program that steps this world has ended")
            return
        now = asyncio.get_running_loop().time()
        self._failures = [each for each in self._failures if now - each < 60.0] + [now]
        if len(self._failures) > MOST_BREAKDOWNS:
            self._audience.set_trouble(f"the world failed again ({words}): restart the server")
            del self.panes[pane]
            return
        self._audience.say(f"the world failed ({words}) and is restarted")
        self.begin(pane, runner.source)


def described(source: SceneSource) -> str:
    """Return the title of a scene, followed by the chosen law."""
    choices = [f"{key} {value}" for key, value in (("law", source.law), ("strain", source.strain)) if value]
    choices += [f"flips {source.flips}"] if source.flips else []
    return ", ".join([source.title, *choices])
