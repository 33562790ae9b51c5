"""What a live view costs, and how late it is: a visitor without a browser, on this machine."""

from __future__ import annotations

import asyncio
import json
import struct
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from websockets.asyncio.client import ClientConnection, connect

from taichi_soft.core.errors import StateError
from taichi_soft.live.packets import PICTURE
from taichi_soft.live.scene import SceneSource
from taichi_soft.live.server import LiveServer

COUNTS = (1, 16, 64)
"""Spheres in a world."""

SECONDS = 6.0
"""That each part is measured for."""

PULLS = 40
"""Moves of the hand whose way to a picture is timed."""

_SCENE = """\
from taichi_soft import Material, World, sphere

world = World(soft_contact=True)
mesh, material = sphere(0.3, 4), Material(young=1.5e5, poisson=0.4, density=500.0, damping_ratio=0.15)
for i in range({count}):
    world.add_body(mesh, material, position=(0.8 * (i % 8), 0.8 * (i // 8), 0.35))
world.build()
"""


@dataclass(frozen=True)
class LiveCost:
    """Of one world: `step_ms` are the 50th and 99th percentile, without a visitor and with one."""

    spheres: int
    triangles: int
    packet: int  # bytes of a picture
    pictures: float  # a second
    latency_ms: tuple[float, float]  # 50th and 95th percentile, from a move to the first picture with it
    alone_ms: tuple[float, float]
    visited_ms: tuple[float, float]


def measure(on_part: Callable[[str], object]) -> list[LiveCost]:
    """Serve worlds of several sizes to one visitor, and look at the clock.

    Args:
        on_part: is told what is measured next.
    """
    return asyncio.run(_measured(on_part))


async def _measured(on_part: Callable[[str], object]) -> list[LiveCost]:
    found = []
    for count in COUNTS:
        on_part(f"{count} spheres")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "spheres.py"
            path.write_text(_SCENE.format(count=count), encoding="utf-8")
            server = LiveServer(SceneSource("script", str(path)), port=0)
            await server.open()
            try:
                while not server.panes:
                    if server.trouble is not None:
                        raise StateError(server.trouble)
                    await asyncio.sleep(0.1)
                found.append(await _cost(server, count))
            finally:
                await server.close()
    return found


async def _cost(server: LiveServer, count: int) -> LiveCost:
    await asyncio.sleep(2.0)
    alone = await _step_times(server, None)
    async with connect(f"ws://127.0.0.1:{server.port}/live", max_size=None, compression=None) as socket:
        reader = _Reader(socket)
        await reader.listen(2.0)
        reader.pictures, start = 0, time.perf_counter()
        visited = await _step_times(server, reader)
        pictures = reader.pictures / (time.perf_counter() - start)
        latencies = [await _latency(reader, i) for i in range(PULLS)]
    p50, p95 = (float(each) for each in np.percentile(np.array(latencies) * 1e3, (50, 95)))
    return LiveCost(count, reader.triangles, reader.size, pictures, (p50, p95), alone, visited)


async def _step_times(server: LiveServer, reader: _Reader | None) -> tuple[float, float]:
    """What a step took at its 50th and 99th percentile, in the last four seconds."""
    await (asyncio.sleep(SECONDS) if reader is None else reader.listen(SECONDS))
    state = server.panes[0].state
    assert state is not None
    return state["step_ms"][0], state["step_ms"][1]


class _Reader:
    """Takes what a page would take."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.pictures = self.size = self.triangles = 0
        self.corner = np.zeros(3)  # highest of all vertices

    async def listen(self, seconds: float) -> None:
        end = time.perf_counter() + seconds
        while (left := end - time.perf_counter()) > 0:
            try:
                await asyncio.wait_for(self.take(), left)
            except asyncio.TimeoutError:
                return

    async def take(self) -> None:
        message = await self.socket.recv()
        if isinstance(message, str):
            return
        if message[0] != PICTURE:
            length = struct.unpack_from("<I", message, 4)[0]
            header: dict[str, Any] = json.loads(message[8 : 8 + length])
            self.triangles = header["arrays"]["triangles"][1][0]
            return
        number = struct.unpack_from("<I", message, 4)[0]
        low, size = np.frombuffer(message, "<f4", 3, 24), np.frombuffer(message, "<f4", 3, 36)
        self.corner, self.size = low.astype(float) + size, len(message)
        self.pictures += 1
        await self.socket.send(json.dumps({"do": "seen", "number": number}))

    async def say(self, do: str, **rest: Any) -> None:
        await self.socket.send(json.dumps({"do": do, **rest}))


async def _latency(reader: _Reader, number: int) -> float:
    """From a grab that pulls a resting body upwards to the first picture in which it has moved [s]."""
    await reader.say("reset")
    await reader.listen(0.6 + 0.013 * (number % 7))  # anywhere between two pictures
    await reader.say("grab", origin=[0.0, 0.0, 5.0], direction=[0.0, 0.0, -1.0])
    await reader.listen(0.1)
    rest, start = reader.corner[2], time.perf_counter()
    await reader.say("move", point=[0.0, 0.0, 3.0])
    while reader.corner[2] < rest + 1e-3:
        await reader.take()
        if time.perf_counter() - start > 5.0:
            break
    found = time.perf_counter() - start
    await reader.say("release")
    return found
