"""Entry point of the process that serves a world stepped by another program."""

from __future__ import annotations

import asyncio
import os
import sys
from multiprocessing.connection import Client

from taichi_soft.live.guard import VIEW_KEY
from taichi_soft.live.scene import SceneSource
from taichi_soft.live.server import LiveServer


async def _serve(place: str) -> None:
    host, port = place.rsplit(":", 1)
    connection = Client((host, int(port)), authkey=bytes.fromhex(os.environ.pop(VIEW_KEY)))
    server = LiveServer(SceneSource(), port=0, attached=connection)
    print(await server.open(), flush=True)
    while not server.worlds.panes[0].is_lost:
        await asyncio.sleep(0.2)
    await server.close()


if __name__ == "__main__":
    asyncio.run(_serve(sys.argv[1]))
