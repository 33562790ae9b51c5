"""Serves a live world to browsers: pictures to each visitor as fast as it takes them, and wishes back."""

from __future__ import annotations

import asyncio
import json
import logging
import math
import secrets
import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from http import HTTPStatus
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
from websockets.asyncio.server import Server as Listening
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from taichi_soft import PRESETS
from taichi_soft.core.errors import OptionError, TaichiSoftError
from taichi_soft.elements.laws import LAWS
from taichi_soft.live.choices import SHAPES
from taichi_soft.live.controls import SLIDERS
from taichi_soft.live.guard import LARGEST_UPLOAD, MOST_VISITORS, Allowance, Guard
from taichi_soft.live.packets import drawn_packet, numbered
from taichi_soft.live.page_files import page_files, response
from taichi_soft.live.pane import Runner
from taichi_soft.live.saving import FILM_FPS, film_file, packed
from taichi_soft.live.scene import SceneSource
from taichi_soft.live.tints import QUANTITIES
from taichi_soft.live.uploads import require_mesh
from taichi_soft.live.wishes import wish_of
from taichi_soft.meshing.surfaces import Up, assumed_up

UNSEEN = 2
"""Pictures on their way to a visitor: more wait until it has shown one of these, and are then left out."""

MOST_BREAKDOWNS = 2
"""Of a world in a minute, after which it is not made anew."""

MOST_MESHES = 8
"""That visitors add: a world has room for bodies of each."""

BETWEEN_CHOICES = 1.0
"""Seconds: each choice starts a process."""

VIEWED = ("grab", "move", "release", "tint")
"""What a visitor may do to a world that another program steps."""

_log = logging.getLogger("taichi_soft")


@dataclass
class Visitor:
    """One page that is open."""

    number: int
    connection: ServerConnection
    allowance: Allowance = field(default_factory=Allowance)
    sent: int = 0  # pictures
    seen: int = 0  # that it has told to be shown
    last: dict[int, tuple[int, int, int]] = field(default_factory=dict)  # by pane: runner, version, number
    told: list[str] = field(default_factory=list)  # words that wait to be sent
    upload: tuple[str, Up | None] | None = None  # name and upward axis of the file that comes next
    wake: asyncio.Event = field(default_factory=asyncio.Event)


class LiveServer:
    """Runs worlds in processes of their own, and lets visitors see and touch them.

    Args:
        source: what the first world is made from.
        host: address to bind to; any but a loopback one asks for a token.
        port: 0 takes a free one.
        attached: to a world that another program steps, in place of one made from `source`.
    """

    def __init__(
        self,
        source: SceneSource,
        *,
        host: str = "127.0.0.1",
        port: int = 8080,
        attached: Connection | None = None,
    ) -> None:
        self.source, self.host, self.port, self.attached = source, host, port, attached
        self.guard: Guard
        self.visitors: dict[int, Visitor] = {}
        self.panes: dict[int, Runner] = {}  # whose worlds are shown
        self.coming: dict[int, Runner] = {}  # by pane, those that compile
        self.given: dict[str, float] = {}  # values of sliders
        self.paused, self.tint = False, None
        self.made: dict[str, tuple[str, str, bytes]] = {}  # downloads: kind, name, bytes
        self._count = 0
        self._files = page_files()
        self._folder = tempfile.TemporaryDirectory(prefix="taichi-soft-live-", ignore_cleanup_errors=True)
        self.trouble: str | None = None  # why there is no world
        self._broken: list[float] = []  # when worlds broke down
        self._last_choice = -math.inf
        self._is_reading = self._is_drawing = False  # a visitor's file; a film
        self._filming: Runner | None = None  # which was asked for its last seconds
        self._film: BaseProcess | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        self._listening: Listening | None = None

    async def open(self) -> str:
        """Begin to serve. Returns: the address to open. Raises: OSError where the port is taken."""
        self._loop = asyncio.get_running_loop()
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
            self._begin(0, self.source)
        else:
            self.panes[0] = Runner(self._loop, self.attached, self.source, partial_heard(self, 0))
        return self.guard.address()

    async def close(self) -> None:
        """End all processes and connections."""
        for runner in [*self.panes.values(), *self.coming.values()]:
            runner.stop()
        if self._film is not None and self._film.is_alive():
            self._film.kill()
        if self._listening is not None:
            self._listening.close()
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._listening.wait_closed(), 5.0)
        for runner in [*self.panes.values(), *self.coming.values()]:
            await asyncio.to_thread(runner.end)
        self._folder.cleanup()

    # Worlds.

    def _begin(self, pane: int, source: SceneSource, *, is_fresh: bool = False) -> None:
        """Make a world beside the one that is shown, which goes on until the new one is ready."""
        if pane in self.coming:
            self.coming.pop(pane).kill()
        self.trouble = None
        self._count += 1
        folder = Path(self._folder.name) / str(self._count)
        heard = partial_heard(self, pane)
        runner = Runner.started(self._loop, folder, source, dict(self.given), heard)
        runner.is_fresh = is_fresh or self._restarts(pane)
        self.coming[pane] = runner
        self._say(f"compiling {_described(source)}" + (": the world goes on meanwhile" if self.panes else ""))

    def heard(self, pane: int, runner: Runner, message: tuple[Any, ...]) -> None:
        """What a world tells."""
        name, *rest = message
        is_shown, is_coming = self.panes.get(pane) is runner, self.coming.get(pane) is runner
        if runner.is_over or not (is_shown or is_coming):
            return
        if name == "ready":
            self._switch(pane, runner)
        elif name == "failed":
            self._fail(pane, runner, rest[0])
        elif name == "ended":
            self._fail(pane, runner, "its process ended")
        elif name == "said":
            self._say(rest[0])
        elif name == "motion" and is_shown and pane in self.coming and self.coming[pane].is_asked:
            self._take_over(pane, rest[0])
        elif name == "saved":
            number, script, snapshot = rest
            self._offer(number, "application/zip", "scene.zip", packed(script, snapshot, runner.source))
        elif name == "filmed":
            self._filming, self._is_drawing = None, bool(rest[1])
            if not self._is_drawing:
                return
            task = self._loop.create_task(self._draw_film(*rest))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)
        elif name in ("frame", "drawn", "state"):
            self._wake()

    def _switch(self, pane: int, runner: Runner) -> None:
        """Show a world that is ready: from where the bodies of the one before it are."""
        before = self.panes.get(pane)
        goes_on = before is not None and not before.is_lost and not runner.is_fresh
        if before is not None and goes_on and before.send("motion"):
            runner.is_asked = True
        elif pane == 1 and before is None and 0 in self.panes:
            self._show(pane, runner)
            self.reset_all()
        else:
            self._show(pane, runner)

    def _take_over(self, pane: int, motion: Any) -> None:
        runner = self.coming[pane]
        runner.send("take_motion", motion)
        self._show(pane, runner)

    def _show(self, pane: int, runner: Runner) -> None:
        before = self.panes.get(pane)
        self.panes[pane] = runner
        self.coming.pop(pane, None)
        if self.tint:
            runner.send("tint", self.tint)
        if before is not None:
            before.stop()
        for name, value in self.given.items():
            runner.send("set", name, value, key=("set", name))
        for mesh in runner.source.meshes:
            if before is None or mesh not in before.source.meshes:
                runner.send("spawn", Path(mesh).stem)
        runner.send("pause", self.paused)
        self._say(f"{_described(runner.source)} is ready")
        self._wake()

    def reset_all(self) -> None:
        """Worlds from their beginnings. One with code of its own is made anew: no snapshot has what that
        remembers.
        """
        for pane, runner in list(self.panes.items()):
            if self._restarts(pane):
                self._begin(pane, runner.source, is_fresh=True)
            else:
                runner.send("reset")

    def _restarts(self, pane: int) -> bool:
        runner = self.panes.get(pane)
        return runner is not None and bool((runner.state or {}).get("restarts"))

    def _fail(self, pane: int, runner: Runner, words: str) -> None:
        """A world that could not be made is left out; one that broke down is made anew."""
        runner.stop()
        runner.is_lost = True
        if self.coming.get(pane) is runner:
            del self.coming[pane]
            words = f"{_described(runner.source)}: {words}"
            self._say(words)
            if not self.panes:
                self.trouble = words
                _log.warning("live: %s", words)
            return
        if pane in self.coming:  # which is shown once it is ready
            if self.coming[pane].is_asked:
                self._show(pane, self.coming[pane])
            return
        if self.attached is not None:
            self._say("the program that steps this world has ended")
            return
        now = self._loop.time()
        self._broken = [each for each in self._broken if now - each < 60.0] + [now]
        if len(self._broken) > MOST_BREAKDOWNS:
            self.trouble = f"the world broke down again ({words}): end it and begin anew"
            self._say(self.trouble)
            del self.panes[pane]
            return
        self._say(f"the world broke down ({words}): it is made anew")
        self._begin(pane, runner.source)

    # Visitors.

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """A file of the page, or None for what becomes a connection."""
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        host, origin = ", ".join(hosts), ", ".join(origins) if origins else None
        refused = self.guard.refusal(request.path, host, origin)
        if refused is not None:
            return response(refused[0], "text/plain", refused[1].encode())
        path = urlsplit(request.path).path
        if path == "/live":
            if len(self.visitors) >= MOST_VISITORS:
                words = f"{MOST_VISITORS} visitors are here already"
                return response(HTTPStatus.SERVICE_UNAVAILABLE, "text/plain", words.encode())
            return None
        if path in self._files:
            return response(HTTPStatus.OK, *self._files[path])
        made = self.made.get(path.removeprefix("/made/"))
        if made is not None:
            return response(HTTPStatus.OK, made[0], made[2], name=made[1])
        return response(HTTPStatus.NOT_FOUND, "text/plain", b"there is no such page")

    async def _visit(self, connection: ServerConnection) -> None:
        """One page, from its coming to its going."""
        self._count += 1
        visitor = self.visitors[self._count] = Visitor(self._count, connection)
        speaking = asyncio.create_task(self._speak(visitor))
        try:
            await connection.send(json.dumps({"hello": visitor.number, **self._offered()}))
            for runner in self.coming.values():
                self._tell(visitor, f"compiling {_described(runner.source)}")
            if self.trouble is not None:
                self._tell(visitor, self.trouble)
            visitor.wake.set()
            async for message in connection:
                if not visitor.allowance.take():
                    await connection.close(1008, "too many messages")
                    return
                self._hear(visitor, message)
        except ConnectionClosed:
            pass
        finally:
            del self.visitors[visitor.number]
            for runner in self.panes.values():
                runner.send("release", visitor.number)
            speaking.cancel()

    def _offered(self) -> dict[str, Any]:
        """What a page needs to know to draw its controls."""
        sliders = [asdict(each) for each in SLIDERS.values()]
        laws = [{"name": law.name, "about": law.summary} for law in LAWS.values()]
        presets = {
            name: {"young": each.young, "poisson": each.poisson, "damping": each.damping_ratio}
            for name, each in PRESETS.items()
            if SLIDERS["poisson"].low <= float(np.max(each.poisson)) <= SLIDERS["poisson"].high
        }
        offered = {"sliders": sliders, "laws": laws, "quantities": list(QUANTITIES), "presets": presets}
        return {**offered, "limit": LARGEST_UPLOAD, "is_view": self.attached is not None}

    def _hear(self, visitor: Visitor, message: str | bytes) -> None:
        try:
            if isinstance(message, bytes):
                self._take_upload(visitor, message)
                return
            self._obey(visitor, wish_of(message))
        except TaichiSoftError as error:
            self._put(visitor, refused=str(error))

    def _obey(self, visitor: Visitor, wish: dict[str, Any]) -> None:
        do, runner = wish["do"], self.panes.get(wish["pane"])
        if do == "seen":
            visitor.seen = max(visitor.seen, min(wish["number"], visitor.sent))
            visitor.wake.set()
        elif self.attached is not None and do not in VIEWED:
            raise OptionError("the program that steps this world decides that")
        elif do == "upload":
            visitor.upload = wish["name"], wish["up"]
        elif do in ("choose", "compare"):
            self._choose(do, wish)
        elif do == "alone":
            for runners in (self.panes, self.coming):
                if 1 in runners:
                    runners.pop(1).kill()  # also one that compiles, and hears nothing
            self._wake()
        elif runner is None:
            raise OptionError(
                "there is no second world" if wish["pane"] else "there is no world yet: it is being compiled"
            )
        elif do in ("grab", "move", "release"):
            values = [wish[key] for key in ("origin", "direction", "point", "number") if key in wish]
            key = ("move", visitor.number) if do == "move" else None
            self._require(runner.send(do, visitor.number, *values, key=key))
        elif do == "save":
            self._save(visitor, runner, wish["what"])
        elif do == "reset":
            if any(map(self._restarts, self.panes)):
                self._require_patience()
            self.reset_all()
        else:
            self._obey_for_all(wish)

    def _save(self, visitor: Visitor, runner: Runner, what: str) -> None:
        if what == "film":
            # One whose world has ended meanwhile never comes.
            is_asked = self._filming is not None and not self._filming.is_over
            if is_asked or self._is_drawing:
                raise OptionError("a film is being drawn: wait until it is there")
        self._require(runner.send("film" if what == "film" else "save", visitor.number))
        if what == "film":
            self._filming = runner

    def _choose(self, do: str, wish: dict[str, Any]) -> None:
        """Compile another law, in place of the one that is shown or beside it."""
        self._require_patience()
        chosen = {key: wish[key] for key in ("law", "strain", "flips")}
        pane = 1 if do == "compare" else wish["pane"]
        self._begin(pane, replace(self._source(0 if do == "compare" else pane), **chosen))

    def _require_patience(self) -> None:
        now = self._loop.time()
        if now - self._last_choice < BETWEEN_CHOICES:
            raise OptionError("a world was begun just now: wait a second")
        self._last_choice = now

    def _obey_for_all(self, wish: dict[str, Any]) -> None:
        """What both worlds get."""
        do, key = wish["do"], None
        values = [value for name, value in wish.items() if name not in ("do", "pane")]
        if do == "set":
            self.given[wish["name"]] = wish["value"]
            key = "set", wish["name"]
        elif do == "pause":
            self.paused = wish["is_paused"]
        elif do == "step":
            self.paused = True
        elif do == "tint":
            self.tint = wish["quantity"]
        for runner in [*self.panes.values(), *(self.coming.values() if do == "set" else ())]:
            self._require(runner.send(do, *values, key=key))

    def _require(self, is_taken: bool) -> None:
        if not is_taken:
            raise OptionError("the world is busy: too many wishes wait")

    def _source(self, pane: int) -> SceneSource:
        for runners in (self.coming, self.panes):
            if pane in runners:
                return runners[pane].source
        return self.source

    def _take_upload(self, visitor: Visitor, content: bytes) -> None:
        """A visitor's mesh: looked at in a process of its own, and then a world with room for it is made."""
        upload, visitor.upload = visitor.upload, None
        if upload is None:
            raise OptionError("a file came without its name")
        if self._is_reading:
            raise OptionError("another file is being read: wait until it is there")
        if len(self._source(0).meshes) >= MOST_MESHES:
            raise OptionError(f"{MOST_MESHES} meshes were added: that is what there is room for")
        self._is_reading = True
        task = self._loop.create_task(self._add_mesh(visitor, *upload, content))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _add_mesh(self, visitor: Visitor, name: str, up: Up | None, content: bytes) -> None:
        assumed = assumed_up(Path(name).name) if up is None else ""
        self._tell(visitor, f"looking at {name}" + (f": {assumed}" if assumed else ""))
        taken = {*SHAPES, *(Path(each).stem for each in self._source(0).meshes)}
        folder = Path(self._folder.name) / f"mesh{secrets.token_hex(4)}"
        try:
            path = await asyncio.to_thread(require_mesh, folder, name, content, taken, up)
        except TaichiSoftError as error:
            self._put(visitor, refused=str(error))
            return
        finally:
            self._is_reading = False
        for pane in sorted({0, *self.panes, *self.coming}):
            source = self._source(pane)
            self._begin(pane, replace(source, meshes=(*source.meshes, str(path))))

    def _offer(self, number: int, kind: str, name: str, content: bytes) -> None:
        """Let a visitor fetch a file, by a name that nobody guesses."""
        key = secrets.token_urlsafe(16)
        self.made[key] = kind, name, content
        while len(self.made) > 8:
            del self.made[next(iter(self.made))]
        visitor = self.visitors.get(number)
        if visitor is not None:
            self._put(visitor, made=f"/made/{key}", name=name)

    async def _draw_film(self, number: int, frames: str) -> None:
        visitor = self.visitors.get(number)
        if visitor is not None:
            self._tell(visitor, "drawing the film: up to a minute")
        path = f"{frames}.mp4"
        process = get_context("spawn").Process(target=film_file, args=(frames, path, FILM_FPS), daemon=True)
        process.start()
        self._film = process
        await asyncio.to_thread(process.join)
        self._is_drawing = False
        Path(frames).unlink(missing_ok=True)
        if process.exitcode != 0 or not Path(path).is_file():
            if visitor is not None:
                self._tell(visitor, "the film could not be drawn: the terminal says why")
            return
        self._offer(number, "video/mp4", "live.mp4", Path(path).read_bytes())
        Path(path).unlink()

    # What visitors are sent.

    def _say(self, words: str) -> None:
        """To everybody."""
        _log.info("live: %s", words)
        for visitor in self.visitors.values():
            self._tell(visitor, words)

    def _tell(self, visitor: Visitor, words: str) -> None:
        self._put(visitor, said=words)

    def _put(self, visitor: Visitor, **message: str) -> None:
        visitor.told.append(json.dumps(message))
        del visitor.told[:-20]  # of one who does not listen
        visitor.wake.set()

    def _wake(self) -> None:
        for visitor in self.visitors.values():
            visitor.wake.set()

    async def _speak(self, visitor: Visitor) -> None:
        """Send what is new, for as long as it is there; nobody else waits for it."""
        states: dict[int, Any] = {}
        panes: list[int] = []
        with suppress(ConnectionClosed):
            while True:
                await visitor.wake.wait()
                visitor.wake.clear()
                while visitor.told:
                    await visitor.connection.send(visitor.told.pop(0))
                if panes != sorted(self.panes):
                    panes = sorted(self.panes)
                    await visitor.connection.send(json.dumps({"panes": panes}))
                for pane, runner in list(self.panes.items()):
                    if runner.state is not None and states.get(pane) is not runner.state:
                        states[pane] = runner.state
                        source = runner.source
                        chosen = {"law": source.law, "strain": source.strain, "flips": source.flips}
                        told = {"pane": pane, "state": runner.state, "chosen": chosen, "tint": self.tint}
                        await visitor.connection.send(json.dumps(told))
                    await self._send_picture(visitor, pane, runner)

    async def _send_picture(self, visitor: Visitor, pane: int, runner: Runner) -> None:
        """The newest, unless those before it are not seen yet."""
        if runner.drawn is None or visitor.sent - visitor.seen >= UNSEEN * len(self.panes):
            return
        version, number, packet = runner.newest_packet(pane)
        identity = id(runner), version
        header, arrays = runner.drawn
        if header["version"] != version or visitor.last.get(pane) == (*identity, number):
            return
        if visitor.last.get(pane, (0, 0, 0))[:2] != identity:
            await visitor.connection.send(drawn_packet(pane, header, arrays))
        pull = runner.pulls.pop(visitor.number, None)
        if pull is not None:  # so the page can tell how late its pictures are
            await visitor.connection.send(json.dumps({"pull": pull}))
        visitor.last[pane] = *identity, number
        visitor.sent += 1
        await visitor.connection.send(numbered(packet, visitor.sent))


def partial_heard(server: LiveServer, pane: int) -> Callable[[Runner, tuple[Any, ...]], None]:
    """What a runner of a pane calls."""
    return lambda runner, message: server.heard(pane, runner, message)


def _described(source: SceneSource) -> str:
    choices = [f"{key} {value}" for key, value in (("law", source.law), ("strain", source.strain)) if value]
    choices += [f"flips {source.flips}"] if source.flips else []
    return ", ".join([source.title, *choices])
