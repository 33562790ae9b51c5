"""Measure the cost and the latency of a live view, with a local visitor instead of a browser."""

from __future__ import annotations

import asyncio
import json
import struct
import tempfile
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
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
"""Numbers of spheres in the measured worlds."""

SECONDS = 11.0
"""Length of a measurement [s]. A world reports percentiles of its last 600 steps, which take 10 s. A
measurement is longer, so that these steps do not include steps of the previous measurement."""

TURNS = 5
"""Number of turns. Each turn consists of a measurement without and a measurement with a visitor."""

PULLS = 40
"""Number of timed moves of a grab."""

_SCENE = """\
from taichi_soft import Material, World, sphere

world = World(sleep_speed=0)
mesh, material = sphere(0.3, 4), Material(young=1.5e5, poisson=0.4, density=500.0, damping_ratio=0.15)
for i in range({count}):
    world.add_body(mesh, material, position=(0.8 * (i % 8), 0.8 * (i // 8), 0.35))
world.build()
"""


@dataclass(frozen=True)
class LiveCost:
    """Cost of the live view of one world.

    Attributes:
        alone_ms: 50th and 99th percentile of the step time without a visitor. Both are medians of the turns.
        visited_ms: 50th and 99th percentile of the step time with a visitor. Both are medians of the turns.
        ratios: for each turn, the 99th percentile with a visitor divided by the 99th percentile without a
            visitor, ascending.
    """

    spheres: int
    triangles: int
    packet: int  # size of a frame [bytes]
    pictures: float  # frames per second
    latency_ms: tuple[float, float]  # time until a move is shown, 50th and 95th percentile
    alone_ms: tuple[float, float]
    visited_ms: tuple[float, float]
    ratios: tuple[float, ...]


def measure(on_part: Callable[[str], object]) -> list[LiveCost]:
    """Serve worlds of several sizes to one visitor. Returns: the cost of each world.

    Args:
        on_part: called with the name of each measurement before it starts.
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
                while not server.worlds.panes:
                    if server.audience.trouble is not None:
                        raise StateError(server.audience.trouble)
                    await asyncio.sleep(0.1)
                found.append(await _cost(server, count))
            finally:
                await server.close()
    return found


async def _cost(server: LiveServer, count: int) -> LiveCost:
    alone, visited, rates = [], [], []
    for _ in range(TURNS):
        await asyncio.sleep(SECONDS)
        alone.append(_step_times(server))
        async with _visitor(server) as reader:
            await reader.listen(SECONDS)
            visited.append(_step_times(server))
            rates.append(reader.pictures / SECONDS)
    async with _visitor(server) as reader:
        await reader.listen(0.5)
        latencies = [await _latency(reader, i) for i in range(PULLS)]
    return LiveCost(
        count,
        reader.triangles,
        reader.size,
        float(np.median(rates)),
        _pair(np.percentile(np.array(latencies) * 1e3, (50, 95))),
        _pair(np.median(alone, axis=0)),
        _pair(np.median(visited, axis=0)),
        tuple(sorted(with_one[1] / without[1] for with_one, without in zip(visited, alone, strict=True))),
    )


def _pair(numbers: np.ndarray) -> tuple[float, float]:
    return float(numbers[0]), float(numbers[1])


def _step_times(server: LiveServer) -> tuple[float, float]:
    """Return the 50th and 99th percentile of the last 600 step times [ms]."""
    state = server.worlds.panes[0].state
    assert state is not None
    return state["step_ms"][0], state["step_ms"][1]


@asynccontextmanager
async def _visitor(server: LiveServer) -> AsyncIterator[_Reader]:
    address = f"ws://127.0.0.1:{server.port}/live"
    async with connect(address, max_size=None, compression=None) as socket:
        yield _Reader(socket)


class _Reader:
    """Simulated visitor. It receives the same packets as the web page."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.pictures = self.size = self.triangles = 0
        self.corner = np.zeros(3)  # largest coordinates of all vertices

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
    """Grab and lift a resting body. Returns: the time until the first frame in which it is lifted [s]."""
    await reader.say("reset")
    await reader.listen(0.6 + 0.013 * (number % 7))  # vary the time between a frame and the following move
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
