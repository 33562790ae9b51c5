"""Show a world in a browser while a notebook or a script steps it."""

from __future__ import annotations

import os
import secrets
import subprocess
import sys
import tempfile
import threading
import weakref
from collections.abc import Mapping
from html import escape
from multiprocessing.connection import Listener
from pathlib import Path
from typing import Any

from engine_adapter import EngineAdapter, FixedStep
from taichi_soft import Body, StateError, World
from taichi_soft.core.checks import as_count
from taichi_soft.core.errors import OptionError
from taichi_soft.core.extras import require_extra
from taichi_soft.live.guard import VIEW_KEY
from taichi_soft.live.scene import Scene, SceneSource, framing_of
from taichi_soft.live.simulation import Simulation
from taichi_soft.render.arguments import as_color
from taichi_soft.render.colors import Color


class View:
    """A live view, returned by `view`, of a world that this program steps.

    A notebook shows the view if it is the last expression of a cell. Any browser on this machine can open
    `address`.
    """

    def __init__(self, world: World, colors: Mapping[Body, Color], height: int) -> None:
        """Use `view` instead."""
        self._world, self._height = world, height
        self._folder = tempfile.TemporaryDirectory(prefix="taichi-soft-view-", ignore_cleanup_errors=True)
        key = secrets.token_bytes(16)
        with Listener(("127.0.0.1", 0), authkey=key) as listener:
            place = f"{listener.address[0]}:{listener.address[1]}"
            command = [sys.executable, "-m", "taichi_soft.live.serving", place]
            path = os.pathsep.join(each for each in sys.path if each)
            environment = {**os.environ, VIEW_KEY: key.hex(), "PYTHONPATH": path}
            # A separate process group: interrupting a cell of a notebook must not end the server.
            group: dict[str, Any] = {"start_new_session": True}
            if sys.platform == "win32":
                group = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
            streams: dict[str, Any] = {"stdout": subprocess.PIPE, "text": True}
            self._server = subprocess.Popen(command, env=environment, **streams, **group)
            self._connection = _accepted(listener, self._server)
        self._end = weakref.finalize(self, _end, self._server, self._connection, self._folder)
        assert self._server.stdout is not None
        self.address = self._server.stdout.readline().strip()
        if not self.address:
            self._end()
            raise StateError("the server of this view could not start: see its output above")
        slots = {body.index: color for body, color in colors.items()}
        scene = Scene("a world", world, FixedStep(), framing_of(world), None, slots)
        self._simulation = Simulation(self._connection, Path(self._folder.name), scene, SceneSource())
        self._simulation.is_playing = True
        self._simulation.describe()
        self.update()

    def update(self, alpha: float = 1.0) -> None:
        """Show the current state and apply visitors' grabs. Call this once per frame, between steps.

        At most 60 frames per second are sent, even if you call this more often.
        Args:
            alpha: interpolation between the previous step (0) and the last one (1).
        Raises: StateError after `close`.
        """
        if not self._end.alive:
            raise StateError("this view is closed: call view(world) again")
        try:
            self._simulation.look(alpha)
        except (EOFError, OSError) as error:
            self.close()
            raise StateError("the server of this view has ended: call view(world) again") from error

    def close(self) -> None:
        """Close the view and release all visitors' grabs."""
        try:
            self._simulation.do_release_all()
        finally:
            self._end()

    def __enter__(self) -> View:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _repr_html_(self) -> str:
        """Return HTML that notebooks display."""
        source = escape(self.address, quote=True)
        style = f"width: 100%; height: {self._height}px; border: 1px solid #8a97a5"
        return f'<iframe src="{source}" style="{style}" title="a live world of taichi-soft"></iframe>'


def view(
    world: World | EngineAdapter, *, colors: Mapping[Body, Color] | None = None, height: int = 480
) -> View:
    """Show a built world in a browser or a notebook while your own loop steps it.

        window = view(world)
        for _ in range(600):
            world.step(1 / 60)
            window.update()

    A separate process serves the view. Only this machine can open it. Visitors can rotate the camera, colour
    bodies by stress, and pull bodies.
    Args:
        world: a built world, or its adapter.
        colors: colours of bodies, sRGB from 0 to 1.
        height: height of the view in a notebook [pixels].
    Raises: StateError for a world that is not built; OptionError for another argument; MissingExtraError
        without the extra `live`.
    """
    require_extra("live", "a live world needs")
    found = world.world if isinstance(world, EngineAdapter) else world
    if not isinstance(found, World):
        raise OptionError(f"world must be a World or an EngineAdapter, got {world!r}")
    if not found.is_built:
        raise StateError("the world is not built: call world.build() before view(world)")
    return View(found, _checked({} if colors is None else colors), as_count(height, "height"))


def _checked(colors: Mapping[Body, Color]) -> dict[Body, Color]:
    if not isinstance(colors, Mapping) or not all(isinstance(body, Body) for body in colors):
        raise OptionError(f"colors must be a mapping from bodies to their colours, got {colors!r}")
    for color in colors.values():
        as_color(color, "a color")
    return dict(colors)


def _accepted(listener: Listener, server: subprocess.Popen[str]) -> Any:
    """Wait for the server to connect, and return the connection.

    Raises: StateError if the server ends first.
    """
    found: list[Any] = []
    waiting = threading.Thread(target=lambda: found.append(listener.accept()), daemon=True)
    waiting.start()
    while waiting.is_alive():
        waiting.join(0.1)
        if server.poll() is not None:
            raise StateError(f"the server of this view ended with code {server.returncode}: see its output")
    return found[0]


def _end(server: subprocess.Popen[str], connection: Any, folder: tempfile.TemporaryDirectory[str]) -> None:
    connection.close()
    server.terminate()
    server.wait(10)
    if server.stdout is not None:
        server.stdout.close()
    folder.cleanup()
