"""Serve a live world to browsers: files of the page, a connection per visitor, and requests."""

from __future__ import annotations

import asyncio
import json
import logging
import math
import secrets
import tempfile
from collections.abc import Coroutine
from contextlib import suppress
from dataclasses import asdict, replace
from http import HTTPStatus
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from websockets.asyncio.server import Server as Listening
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from taichi_soft.core.errors import OptionError, TaichiSoftError
from taichi_soft.elements.laws import LAWS
from taichi_soft.live.audience import Audience, Visitor
from taichi_soft.live.choices import SHAPES
from taichi_soft.live.controls import PRESET_SLIDERS, SLIDERS
from taichi_soft.live.downloads import Downloads
from taichi_soft.live.guard import LARGEST_UPLOAD, MOST_VISITORS, Guard
from taichi_soft.live.page_files import page_files, response
from taichi_soft.live.pane import Runner
from taichi_soft.live.requests import merge_key, parse_request
from taichi_soft.live.scene import SceneSource
from taichi_soft.live.tints import QUANTITIES
from taichi_soft.live.uploads import require_mesh
from taichi_soft.live.worlds import Worlds
from taichi_soft.meshing.surfaces import Up, assumed_up

MOST_MESHES = 8
"""Largest number of meshes that visitors can add. A world reserves capacity for bodies of each mesh."""

BETWEEN_CHOICES = 1.0
"""Minimum time between two requests that start a world, such as a change of the law [s]. Each world runs
in a new process."""

VIEWED = ("grab", "move", "release", "tint")
"""Names of the requests that visitors can make if another program steps the world."""


class LiveServer:
    """Runs worlds in separate processes, and serves them to visitors.

    Args:
        source: source of the first world.
        host: address to bind to; any address except loopback requires a token.
        port: port to listen on; 0 chooses a free one.
        attached: connection to a world that another program steps; None to make a world from `source`.
    """

    def __init__(
        self,
        source: SceneSource,
        *,
        host: str = "127.0.0.1",
        port: int = 8080,
        attached: Connection | None = None,
    ) -> None:
        self.host, self.port, self.attached = host, port, attached
        self.guard: Guard
        self._folder = tempfile.TemporaryDirectory(prefix="taichi-soft-live-", ignore_cleanup_errors=True)
        self.audience = Audience()
        self.downloads = Downloads(self.audience)
        self.worlds = Worlds(
            source, Path(self._folder.name), self.audience, self._on_file, is_attached=attached is not None
        )
        self._count = 0
        self._files = page_files()
        self._last_choice = -math.inf
        self.is_reading = False  # True while a visitor's file is read
        self._tasks: set[asyncio.Task[None]] = set()
        self._listening: Listening | None = None

    async def open(self) -> str:
        """Start to serve. Returns: the address that visitors open. Raises: OSError if the port is in use."""
        self._listening = await serve(
            self._visit,
            self.host,
            self.port,
            process_request=self._answer,
            max_size=LARGEST_UPLOAD,
            max_queue=16,
            compression=None,
            ping_interval=10.0,
            ping_timeout=20.0,
            logger=logging.getLogger("taichi_soft.live.websockets"),
        )
        self.port = next(iter(self._listening.sockets)).getsockname()[1]
        self.guard = Guard.of(self.host, self.port)
        if self.attached is None:
            self.worlds.begin(0, self.worlds.source(0))
        else:
            self.worlds.attach(self.attached)
        return self.guard.address()

    async def close(self) -> None:
        """End all processes and connections."""
        for runner in self.worlds.coming.values():
            runner.kill()  # a process does not read messages while it compiles
        for runner in self.worlds.panes.values():
            runner.stop()
        self.downloads.stop()
        if self._listening is not None:
            self._listening.close()
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._listening.wait_closed(), 5.0)
        for runner in self.worlds.runners():
            await asyncio.to_thread(runner.end)
        self._folder.cleanup()

    def _start(self, work: Coroutine[Any, Any, None]) -> None:
        """Run a coroutine in the background."""
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _on_file(self, runner: Runner, message: tuple[Any, ...]) -> None:
        """Handle a file that a world has written for a visitor."""
        if message[0] == "saved":
            _, visitor, script, snapshot = message
            self._start(self.downloads.offer_scene(visitor, script, snapshot, runner.source))
        elif self.downloads.begin_film(message[2]):
            self._start(self.downloads.draw_film(message[1], message[2]))

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return a file of the page, or None for a request that opens a WebSocket."""
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        host, origin = ", ".join(hosts), ", ".join(origins) if origins else None
        refused = self.guard.refusal(request.path, host, origin)
        if refused is not None:
            return response(refused[0], "text/plain", refused[1].encode())
        path = urlsplit(request.path).path
        if path == "/live":
            if len(self.audience.visitors) >= MOST_VISITORS:
                words = f"{MOST_VISITORS} visitors are connected already: try again later"
                return response(HTTPStatus.SERVICE_UNAVAILABLE, "text/plain", words.encode())
            return None
        if path in self._files:
            return response(HTTPStatus.OK, *self._files[path])
        made = self.downloads.file(path.removeprefix("/made/"))
        if made is not None:
            return response(HTTPStatus.OK, made[0], made[2], name=made[1])
        return response(HTTPStatus.NOT_FOUND, "text/plain", b"no such page")

    async def _visit(self, connection: ServerConnection) -> None:
        """Serve one page until it disconnects."""
        self._count += 1
        visitor = self.audience.visitors[self._count] = Visitor(self._count, connection)
        speaking = asyncio.create_task(self.audience.speak(visitor, self.worlds))
        try:
            await connection.send(json.dumps({"hello": visitor.number, **self._offered()}))
            visitor.wake.set()
            async for message in connection:
                if not visitor.allowance.take():
                    await connection.close(1008, "too many messages")
                    return
                self._hear(visitor, message)
        except ConnectionClosed:
            pass
        finally:
            del self.audience.visitors[visitor.number]
            self.worlds.leave(visitor.number)
            speaking.cancel()

    def _offered(self) -> dict[str, Any]:
        """Return the data for the page's controls: sliders, laws, quantities and presets."""
        sliders = [asdict(each) for each in SLIDERS.values()]
        laws = [{"name": law.name, "about": law.summary} for law in LAWS.values()]
        offered = {
            "sliders": sliders,
            "laws": laws,
            "quantities": list(QUANTITIES),
            "presets": list(PRESET_SLIDERS),
        }
        return {**offered, "limit": LARGEST_UPLOAD, "is_view": self.attached is not None}

    def _hear(self, visitor: Visitor, message: str | bytes) -> None:
        try:
            if isinstance(message, bytes):
                self.take_upload(visitor, message)
            else:
                self.obey(visitor, parse_request(message))
        except TaichiSoftError as error:
            visitor.put(refused=str(error))

    def obey(self, visitor: Visitor, request: dict[str, Any]) -> None:
        """Execute a visitor's request. Raises: OptionError if the request is refused."""
        do, runner = request["do"], self.worlds.panes.get(request["pane"])
        if do == "seen":
            visitor.seen = max(visitor.seen, min(request["number"], visitor.sent))
            visitor.wake.set()
        elif self.attached is not None and do not in VIEWED:
            raise OptionError("another program steps this world: change it there")
        elif do == "upload":
            visitor.upload = request["name"], request["up"]
        elif do in ("choose", "compare"):
            self._choose(do, request)
        elif do == "alone":
            self.worlds.show_one()
        elif runner is None:
            missing = "there is no second world", "the world is still being prepared: wait until it is shown"
            raise OptionError(missing[request["pane"] == 0])
        elif do in ("grab", "move", "release"):
            values = [request[key] for key in ("origin", "direction", "point", "number") if key in request]
            self._send(runner, visitor, request, do, visitor.number, *values)
        elif do == "save":
            self._save(runner, visitor, request)
        elif do == "reset":
            if any(map(self.worlds.restarts, self.worlds.panes)):
                self._require_patience()
            self.worlds.reset(visitor.number)
        else:
            self._obey_for_all(visitor, request)

    def _save(self, runner: Runner, visitor: Visitor, request: dict[str, Any]) -> None:
        if request["what"] == "script":
            self._send(runner, visitor, request, "save", visitor.number)
            return
        self.downloads.require_idle()
        self._send(runner, visitor, request, "film", visitor.number)
        self.downloads.film_asked(runner)

    def _choose(self, do: str, request: dict[str, Any]) -> None:
        """Prepare a world with another law. The new world replaces the shown world or appears next to it."""
        self._require_patience()
        chosen = {key: request[key] for key in ("law", "strain", "flips")}
        pane = 1 if do == "compare" else request["pane"]
        self.worlds.begin(pane, replace(self.worlds.source(0 if do == "compare" else pane), **chosen))

    def _require_patience(self) -> None:
        now = asyncio.get_running_loop().time()
        if now - self._last_choice < BETWEEN_CHOICES:
            raise OptionError("another world was started less than a second ago: try again")
        self._last_choice = now

    def _obey_for_all(self, visitor: Visitor, request: dict[str, Any]) -> None:
        """Send a request to all shown worlds."""
        do = request["do"]
        if do == "pause":
            self.worlds.paused = request["is_paused"]
        elif do == "step":
            self.worlds.paused = True
        elif do == "tint":
            self.worlds.tint = request["quantity"]
        values = [value for name, value in request.items() if name not in ("do", "pane")]
        for runner in self.worlds.panes.values():
            self._send(runner, visitor, request, do, *values)

    @staticmethod
    def _send(runner: Runner, visitor: Visitor, request: dict[str, Any], *message: Any) -> None:
        if not runner.send(*message, sender=visitor.number, key=merge_key(request)):
            raise OptionError("too many of your requests are waiting: try again later")

    def take_upload(self, visitor: Visitor, content: bytes) -> None:
        """Check a visitor's mesh in another process, then prepare a world with capacity for its bodies."""
        upload, visitor.upload = visitor.upload, None
        if upload is None:
            raise OptionError("a file arrived without its name")
        if self.is_reading:
            raise OptionError("another file is being read: wait until it is added")
        if len(self.worlds.source(0).meshes) >= MOST_MESHES:
            raise OptionError(f"{MOST_MESHES} meshes is the limit: restart the server to add others")
        self.is_reading = True
        self._start(self._add_mesh(visitor, *upload, content))

    async def _add_mesh(self, visitor: Visitor, name: str, up: Up | None, content: bytes) -> None:
        self.audience.show_activity("mesh", name, "reading the file and making tetrahedra")
        if up is None and (assumed := assumed_up(Path(name).name)):
            visitor.put(said=f"{name}: {assumed}")
        taken = {*SHAPES, *(Path(each).stem for each in self.worlds.source(0).meshes)}
        folder = Path(self._folder.name) / f"mesh{secrets.token_hex(4)}"
        try:
            path = await asyncio.to_thread(require_mesh, folder, name, content, taken, up)
        except TaichiSoftError as error:
            visitor.put(refused=str(error))
            return
        finally:
            self.is_reading = False
            self.audience.end_activity("mesh")
        self.worlds.add_mesh(str(path))
