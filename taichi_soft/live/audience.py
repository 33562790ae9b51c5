"""Visitors of a live world.

Each visitor receives messages, and frames at the rate that the visitor's browser can display.
"""

from __future__ import annotations

import asyncio
import json
import logging
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Protocol

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from taichi_soft.live.guard import Allowance
from taichi_soft.live.packets import drawn_packet, numbered
from taichi_soft.live.pane import Runner
from taichi_soft.live.scene import SceneSource
from taichi_soft.meshing.surfaces import Up

UNSEEN = 2
"""Largest number of frames that were sent to a visitor but are not shown yet. Further frames are skipped."""

MOST_MESSAGES = 20
"""Largest number of messages queued for a visitor. If the queue is full, the oldest message is dropped."""

_log = logging.getLogger("taichi_soft")


class Shown(Protocol):
    """The attributes of `Worlds` that visitors need."""

    panes: dict[int, Runner]
    coming: dict[int, Runner]
    tint: str | None


@dataclass
class Visitor:
    """A visitor: one open page."""

    number: int
    connection: ServerConnection
    allowance: Allowance = field(default_factory=Allowance)
    sent: int = 0  # number of frames sent
    seen: int = 0  # number of the last frame that the page has shown
    # Last frame that was sent, by pane: id of the runner, version of the meshes, number of the frame.
    last: dict[int, tuple[int, int, int]] = field(default_factory=dict)
    messages: list[str] = field(default_factory=list)  # queued messages
    upload: tuple[str, Up | None] | None = None  # name and upward axis of the next file
    wake: asyncio.Event = field(default_factory=asyncio.Event)

    def put(self, **message: str) -> None:
        """Queue a message for the page, as JSON. If the queue is full, drop the oldest message."""
        self.messages.append(json.dumps(message))
        del self.messages[:-MOST_MESSAGES]
        self.wake.set()


@dataclass
class _Activity:
    """A long task that pages show, such as compiling. The fields are those of `Audience.show_activity`."""

    title: str
    step: str
    since: float
    done: int = 0
    about: int = 0


class Audience:
    """All visitors of a server."""

    def __init__(self) -> None:
        self.visitors: dict[int, Visitor] = {}
        self.trouble: str | None = None  # reason why there is no world
        self._activities: dict[str, _Activity] = {}
        self._status_version = 0

    def say(self, words: str) -> None:
        """Queue a message for each visitor, and log the message."""
        _log.info("live: %s", words)
        for visitor in self.visitors.values():
            visitor.put(said=words)

    def refuse(self, number: int, words: str) -> None:
        """Report a refused request to the visitor `number`."""
        if number in self.visitors:
            self.visitors[number].put(refused=words)

    def wake(self) -> None:
        """Wake the tasks that send to visitors, because there is something new to send."""
        for visitor in self.visitors.values():
            visitor.wake.set()

    def show_activity(self, key: str, title: str, step: str, done: int = 0, about: int = 0) -> None:
        """Show a task on all pages until `end_activity`.

        Args:
            key: key of the task; an existing task with this key is replaced.
            title: name of the task.
            step: current step of the task.
            done, about: number of finished parts, and approximate number of all parts; 0 if unknown.
        """
        before = self._activities.get(key)
        since = time.monotonic() if before is None or before.title != title else before.since
        self._activities[key] = _Activity(title, step, since, done, about)
        self._change_status()

    def end_activity(self, key: str) -> None:
        """Stop showing the task with this key, if there is one."""
        if self._activities.pop(key, None) is not None:
            self._change_status()

    def set_trouble(self, words: str | None) -> None:
        """Show the reason why there is no world. None means that a world is shown or being prepared."""
        if words != self.trouble:
            self.trouble = words
            self._change_status()

    def _change_status(self) -> None:
        self._status_version += 1
        self.wake()

    def status(self) -> dict[str, Any]:
        """Return the running tasks, and the reason why there is no world, as plain types for JSON."""
        now = time.monotonic()
        rows = [
            {
                "title": each.title,
                "step": each.step,
                "done": each.done,
                "about": each.about,
                "seconds": round(now - each.since, 1),
            }
            for each in self._activities.values()
        ]
        return {"activities": rows, "trouble": self.trouble}

    async def speak(self, visitor: Visitor, worlds: Shown) -> None:
        """Send updates to a visitor until the visitor leaves. Visitors do not wait for each other."""
        states: dict[int, Any] = {}
        panes: list[int] = []
        version = -1
        send = visitor.connection.send
        with suppress(ConnectionClosed):
            while True:
                await visitor.wake.wait()
                visitor.wake.clear()
                if version != self._status_version:
                    version = self._status_version
                    await send(json.dumps({"status": self.status()}))
                while visitor.messages:
                    await send(visitor.messages.pop(0))
                if panes != sorted(worlds.panes):
                    panes = sorted(worlds.panes)
                    await send(json.dumps({"panes": panes}))
                for pane, runner in list(worlds.panes.items()):
                    if runner.state is not None and states.get(pane) is not runner.state:
                        states[pane] = runner.state
                        coming = worlds.coming.get(pane)
                        state = {
                            "pane": pane,
                            "state": runner.state,
                            "chosen": _choice(runner.source),
                            "coming": None if coming is None else _choice(coming.source),
                            "tint": worlds.tint,
                        }
                        await send(json.dumps(state))
                    await self._send_frame(visitor, pane, runner, len(worlds.panes))

    async def _send_frame(self, visitor: Visitor, pane: int, runner: Runner, panes: int) -> None:
        """Send the newest frame of a pane, unless too many earlier frames are not shown yet."""
        if runner.drawn is None or visitor.sent - visitor.seen >= UNSEEN * panes:
            return
        version, number, packet = runner.newest_packet(pane)
        identity = id(runner), version
        header, arrays = runner.drawn
        if header["version"] != version or visitor.last.get(pane) == (*identity, number):
            return
        if visitor.last.get(pane, (0, 0, 0))[:2] != identity:
            await visitor.connection.send(drawn_packet(pane, header, arrays))
        pull = runner.pulls.pop(visitor.number, None)
        if pull is not None:  # the page needs this number to measure the latency
            await visitor.connection.send(json.dumps({"pull": pull}))
        visitor.last[pane] = *identity, number
        visitor.sent += 1
        await visitor.connection.send(numbered(packet, visitor.sent))


def _choice(source: SceneSource) -> Mapping[str, str | None]:
    return {"law": source.law, "strain": source.strain, "flips": source.flips}
