"""The server's side of a world that runs in its own process."""

from __future__ import annotations

import asyncio
import multiprocessing
import threading
from collections.abc import Callable, Hashable
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from taichi_soft.live.controls import Given
from taichi_soft.live.frame_file import FrameFile
from taichi_soft.live.inbox import SERVER, Inbox
from taichi_soft.live.packets import picture_packet
from taichi_soft.live.scene import SceneSource

Heard = Callable[["Runner", tuple[Any, ...]], None]


class Runner:
    """A world in another process, as the server sees it. One thread sends and one thread receives.

    Neither process waits for the other. Requests wait in an `Inbox`; messages of the world are read
    on arrival.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        connection: Connection,
        source: SceneSource,
        heard: Heard,
        process: BaseProcess | None = None,
    ) -> None:
        """Connect to a world. `process` is the process of the world, or None if another program steps it."""
        self.source, self.heard, self._loop = source, heard, loop
        self._connection, self._process = connection, process
        self.drawn: tuple[dict[str, Any], dict[str, Any]] | None = None
        self.state: dict[str, Any] | None = None
        self.frames: FrameFile | None = None
        self._packed = 0, 0, b""  # newest frame: version, number, packet
        self.pulls: dict[int, int] = {}  # by visitor, number of the move that the newest frame shows
        self.is_over = False
        self.is_lost = False  # True if the connection is lost
        self.is_asked = False  # True after this world has requested the motion of the shown world
        self.is_fresh = False  # True to start in the initial state, False to continue the shown world
        self.keeps_sliders = False  # True to ignore the slider values of the shown world
        self._inbox = Inbox()
        self._changed = threading.Condition()
        for target in (self._listen, self._speak):
            threading.Thread(target=target, daemon=True).start()

    @classmethod
    def started(
        cls,
        loop: asyncio.AbstractEventLoop,
        folder: Path,
        source: SceneSource,
        given: Given,
        heard: Heard,
    ) -> Runner:
        """Start a process that runs `running.run`, and return its runner."""
        from taichi_soft.live.running import run

        folder.mkdir(parents=True, exist_ok=True)
        spawning = multiprocessing.get_context("spawn")
        mine, theirs = spawning.Pipe()
        process = spawning.Process(target=run, args=(theirs, str(folder), source, given), daemon=True)
        process.start()
        theirs.close()
        return cls(loop, mine, source, heard, process)

    def send(self, *message: Any, sender: int = SERVER, key: Hashable = None) -> bool:
        """Queue a request to the world.

        Args:
            sender: number of the visitor.
            key: kind of the request, see `Inbox.put`.
        Returns: False if too many requests of this visitor are queued.
        """
        with self._changed:
            ends = {"is_kept": message[0] == "release", "is_last": message[0] == "leave"}
            if not self._inbox.put(sender, (key, message), key, **ends):
                return False
            self._changed.notify()
        return True

    def stop(self) -> None:
        """Ask the process to end."""
        self.is_over = True
        with self._changed:
            self._inbox.clear()
            self._inbox.put(SERVER, (None, ("stop",)))
            self._changed.notify()

    def kill(self) -> None:
        """Kill the process, even while it compiles."""
        self.stop()
        if self._process is not None:
            self._process.kill()

    def end(self) -> None:
        """Wait until the process has ended. The process stores its compiled kernels at exit."""
        self.stop()
        if self._process is None:
            return
        self._process.join(10.0)
        if self._process.is_alive():
            self._process.kill()
            self._process.join(2.0)

    def newest_packet(self, pane: int) -> tuple[int, int, bytes]:
        """Return the version (0 before the first frame), the number and the packet of the newest frame.

        Each frame is packed only once, for all visitors.
        """
        number = 0 if self.frames is None else self.frames.newest_number
        if self.frames is not None and number != self._packed[1]:
            frame = self.frames.newest()
            if frame is not None:
                self._packed = frame.version, frame.number, picture_packet(pane, frame)
        return self._packed

    def _speak(self) -> None:
        while True:
            with self._changed:
                while (taken := self._inbox.take()) is None:
                    self._changed.wait()
            sender, (key, message) = taken
            try:
                self._connection.send((sender, key, message))
            except (OSError, ValueError):
                return
            if message[0] == "stop":
                return

    def _listen(self) -> None:
        while True:
            try:
                message = self._connection.recv()
            except (EOFError, OSError):
                message = ("ended",)
            try:
                self._loop.call_soon_threadsafe(self._hear, message)
            except RuntimeError:  # the server's loop has ended
                return
            if message[0] == "ended":
                return

    def _hear(self, message: tuple[Any, ...]) -> None:
        if message[0] == "ended":
            self.is_lost = True
        elif message[0] == "drawn":
            _, path, sizes, header, arrays = message
            try:
                self.frames = FrameFile(Path(path), *sizes)
            except OSError:
                return  # newer meshes have replaced the file
            self.drawn = header, arrays
            self._packed = 0, 0, b""
        elif message[0] == "frame":
            self.pulls.update(message[2])
        elif message[0] in ("state", "ready"):
            self.state = message[1]
        self.heard(self, message)
