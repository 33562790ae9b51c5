"""A world that a notebook or a script steps, live in a browser."""

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
    """A window into a world that goes on being stepped here. Made by `view`.

    A notebook shows it where it is the last thing of a cell. `address` opens it anywhere.
    """

    def __init__(self, world: World, colors: Mapping[Body, Color], height: int) -> None:
        """Made by `view`."""
        self._world, self._height = world, height
        self._folder = tempfile.TemporaryDirectory(prefix="taichi-soft-view-", ignore_cleanup_errors=True)
        key = secrets.token_bytes(16)
        with Listener(("127.0.0.1", 0), authkey=key) as listener:
            place = f"{listener.address[0]}:{listener.address[1]}"
            command = [sys.executable, "-m", "taichi_soft.live.serving", place]
            path = os.pathsep.join(each for each in sys.path if each)
            environment = {**os.environ, VIEW_KEY: key.hex(), "PYTHONPATH": path}
            # A group of its own: what interrupts a notebook's cell does not end it.
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
            raise StateError("the server of this view could not begin to serve: see what it said")
        slots = {body.index: color for body, color in colors.items()}
        scene = Scene("a world", world, FixedStep(), framing_of(world), None, slots)
        self._simulation = Simulation(self._connection, Path(self._folder.name), scene, SceneSource())
        self._simulation.is_playing = True
        self._simulation.describe()
        self.update()

    def update(self, alpha: float = 1.0) -> None:
        """Show the world as it is now, and let visitors' hands act: call it once a frame, between steps.

        Pictures are at most 60 a second, however often it is called.
        Args:
            alpha: how far the picture is from the previous step (0) to the last one (1).
        Raises: StateError once closed.
        """
        if not self._end.alive:
            raise StateError("this view was closed: make another")
        try:
            self._simulation.look(alpha)
        except (EOFError, OSError) as error:
            self.close()
            raise StateError("the server of this view has ended: make another") from error

    def close(self) -> None:
        """End it, and let go of what visitors hold."""
        try:
            self._simulation.do_release_all()
        finally:
            self._end()

    def __enter__(self) -> View:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _repr_html_(self) -> str:
        """For notebooks."""
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

    It is served by a process of its own, to this machine only. Visitors turn it, colour it by stress, and
    pull bodies about.
    Args:
        world: built, or an adapter of it.
        colors: of bodies, sRGB from 0 to 1.
        height: in a notebook [pixels].
    Raises: StateError for a world that is not built; OptionError for what is none, and for odd colours or
        heights; MissingExtraError without the extra `live`.
    """
    require_extra("live", "a live world needs")
    found = world.world if isinstance(world, EngineAdapter) else world
    if not isinstance(found, World):
        raise OptionError(f"world must be a World or an EngineAdapter, got {world!r}")
    if not found.is_built:
        raise StateError("the world is not built: call world.build() before it is viewed")
    return View(found, _checked({} if colors is None else colors), as_count(height, "height"))


def _checked(colors: Mapping[Body, Color]) -> dict[Body, Color]:
    if not isinstance(colors, Mapping) or not all(isinstance(body, Body) for body in colors):
        raise OptionError(f"colors is a mapping from bodies to their colours, got {colors!r}")
    for color in colors.values():
        as_color(color, "a color")
    return dict(colors)


def _accepted(listener: Listener, server: subprocess.Popen[str]) -> Any:
    """The connection that a server makes. Raises: StateError where it ends before."""
    found: list[Any] = []
    waiting = threading.Thread(target=lambda: found.append(listener.accept()), daemon=True)
    waiting.start()
    while waiting.is_alive():
        waiting.join(0.1)
        if server.poll() is not None:
            raise StateError(f"the server of this view ended with code {server.returncode}: see what it said")
    return found[0]


def _end(server: subprocess.Popen[str], connection: Any, folder: tempfile.TemporaryDirectory[str]) -> None:
    connection.close()
    server.terminate()
    server.wait(10)
    if server.stdout is not None:
        server.stdout.close()
    folder.cleanup()
