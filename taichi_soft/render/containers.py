"""Kinds of film file: how OpenCV writes each, and how to count what is in it."""

from __future__ import annotations

import contextlib
import os
from abc import ABC, abstractmethod
from collections.abc import Iterator
from pathlib import Path

# Read when OpenCV first opens a film: keeps its codecs from writing to the console (errors are raised here).
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")

import cv2
import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import VideoError

Frame = NDArray[np.uint8]
CODECS = {".mp4": ("mp4v",), ".webm": ("VP90", "VP80")}  # in the order in which they are tried
# Of the ways that OpenCV 5.0 writes GIFs, this pair alone comes near the colours, at a third of the size.
GIF_OPTIONS = (cv2.IMWRITE_GIF_QUALITY, 8, cv2.IMWRITE_GIF_DITHER, cv2.IMWRITE_GIF_FAST_FLOYD_DITHER + 2)
GIF_FASTEST = 50.0  # frames per second; shows are timed in 1/100 s, and viewers slow down what lasts only one


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Keep OpenCV from writing its own messages."""
    before = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(before)


@contextlib.contextmanager
def deaf_console() -> Iterator[None]:
    """Lose what goes to the console's error stream: OpenCV prints there past every setting of its own."""
    console = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(console, 2)
        os.close(console)
        os.close(nowhere)


class Container(ABC):
    """A film that is being written, in blue, green, red order, to a path of its own."""

    @abstractmethod
    def __init__(self, path: Path, fps: float, size: tuple[int, int]) -> None:
        """Open a file of frames of `size` (width, height). Raises: VideoError if it cannot be written."""

    @abstractmethod
    def write(self, frame: Frame) -> None:
        """Add a frame."""

    @abstractmethod
    def finish(self) -> None:
        """Complete the file. Raises: VideoError or cv2.error if that is impossible."""

    @abstractmethod
    def abandon(self) -> None:
        """Let go of the file as it is."""


class Stream(Container):
    """.mp4 and .webm."""

    def __init__(self, path: Path, fps: float, size: tuple[int, int]) -> None:
        for codec in CODECS[path.suffix]:
            with deaf_console():
                self._writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), fps, size)
            if self._writer.isOpened():
                return
        raise VideoError(
            f"this OpenCV cannot write {' or '.join(CODECS[path.suffix])} films: use .gif or .png"
        )

    def write(self, frame: Frame) -> None:
        self._writer.write(frame)

    def finish(self) -> None:
        self._writer.release()

    def abandon(self) -> None:
        self._writer.release()


class Gif(Container):
    """.gif; the frames stay in memory until the end, because OpenCV writes them all at once."""

    def __init__(self, path: Path, fps: float, size: tuple[int, int]) -> None:
        if fps > GIF_FASTEST:
            raise VideoError(
                f"a .gif shows at most {GIF_FASTEST:g} frames per second, got {fps:g}: use .webm or .mp4"
            )
        self._path, self._fps = path, fps
        self._frames: list[Frame] = []

    def write(self, frame: Frame) -> None:
        self._frames.append(frame)

    def finish(self) -> None:
        animation = cv2.Animation()
        animation.frames = self._frames
        # Frames end at the nearest 1/100 s, so that rounding does not add up.
        ends = 10 * np.round(np.arange(len(self._frames) + 1) * 100.0 / self._fps).astype(np.int64)
        animation.durations = np.diff(ends).tolist()
        if not cv2.imwriteanimation(str(self._path), animation, GIF_OPTIONS):
            raise VideoError("OpenCV could not encode the .gif")

    def abandon(self) -> None:
        self._frames = []


class Pictures(Container):
    """.png: one file per frame in a folder."""

    def __init__(self, path: Path, fps: float, size: tuple[int, int]) -> None:
        path.mkdir()
        self._path, self._count = path, 0

    def write(self, frame: Frame) -> None:
        name = self._path / f"{self._count:04d}.png"
        if not cv2.imwrite(str(name), frame):
            raise VideoError(f"OpenCV could not write {name}")
        self._count += 1

    def finish(self) -> None:
        """Nothing is left to do: every frame was complete once written."""

    def abandon(self) -> None:
        """Nothing is open."""


def measure(path: Path) -> tuple[int, set[tuple[int, int]]]:
    """How many frames a finished container holds, and their sizes (width, height)."""
    sizes: list[tuple[int, int]] = []
    if path.is_dir():
        for name in sorted(path.iterdir()):
            picture = cv2.imread(str(name))
            if picture is not None:
                sizes.append((picture.shape[1], picture.shape[0]))
        return len(sizes), set(sizes)
    film = cv2.VideoCapture(str(path))
    while True:
        found, picture = film.read()
        if not found:
            break
        sizes.append((picture.shape[1], picture.shape[0]))
    film.release()
    return len(sizes), set(sizes)
