"""Files that visitors request: a scene's script with its snapshot, and films."""

from __future__ import annotations

import asyncio
import secrets
from multiprocessing import get_context
from multiprocessing.process import BaseProcess
from pathlib import Path

from taichi_soft.core.errors import OptionError
from taichi_soft.live.audience import Audience
from taichi_soft.live.pane import Runner
from taichi_soft.live.saving import FILM_FPS, film_file, packed
from taichi_soft.live.scene import SceneSource

MOST_FILES = 8
"""Largest number of stored files. Further files replace the oldest ones."""


class Downloads:
    """Files for visitors, stored under unguessable keys."""

    def __init__(self, audience: Audience) -> None:
        self._audience = audience
        self._files: dict[str, tuple[str, str, bytes]] = {}
        self._filming: Runner | None = None  # the world that is writing the frames of a film
        self._is_drawing = False
        self._process: BaseProcess | None = None

    def file(self, key: str) -> tuple[str, str, bytes] | None:
        """Return the MIME type, the name and the content of a file; None for an unknown key."""
        return self._files.get(key)

    def stop(self) -> None:
        """Stop the process that renders a film."""
        if self._process is not None and self._process.is_alive():
            self._process.kill()

    def require_idle(self) -> None:
        """Raise an OptionError while a film is being rendered."""
        is_asked = self._filming is not None and not self._filming.is_over
        if is_asked or self._is_drawing:
            raise OptionError("a film is being rendered: wait until it is finished")

    def film_asked(self, runner: Runner) -> None:
        """Record that a film was requested from the world of `runner`."""
        self._filming = runner

    async def offer_scene(self, visitor: int, script: str, snapshot: bytes, source: SceneSource) -> None:
        """Pack a scene and send its download link to the visitor."""
        content = await asyncio.to_thread(packed, script, snapshot, source)
        self._offer(visitor, "application/zip", "scene.zip", content)

    def begin_film(self, frames: str) -> bool:
        """Record that a world has written the frames of a film. Returns: True if there are frames to render.

        Args:
            frames: path of the file with the frames, empty if writing it failed.
        """
        self._filming, self._is_drawing = None, bool(frames)
        return self._is_drawing

    async def draw_film(self, visitor: int, frames: str) -> None:
        """Render a film and send its download link to the visitor."""
        self._audience.show_activity("film", "film", "drawing")
        path = f"{frames}.mp4"
        process = get_context("spawn").Process(target=film_file, args=(frames, path, FILM_FPS), daemon=True)
        process.start()
        self._process = process
        await asyncio.to_thread(process.join)
        self._is_drawing = False
        self._audience.end_activity("film")
        Path(frames).unlink(missing_ok=True)
        if process.exitcode != 0 or not Path(path).is_file():
            self._audience.refuse(visitor, "rendering the film failed: see the terminal")
            return
        self._offer(visitor, "video/mp4", "live.mp4", Path(path).read_bytes())
        Path(path).unlink()

    def _offer(self, number: int, kind: str, name: str, content: bytes) -> None:
        key = secrets.token_urlsafe(16)
        self._files[key] = kind, name, content
        while len(self._files) > MOST_FILES:
            del self._files[next(iter(self._files))]
        if number in self._audience.visitors:
            self._audience.visitors[number].put(made=f"/made/{key}", name=name)
