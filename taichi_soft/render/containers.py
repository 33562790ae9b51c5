"""Film formats: write a film in each format and count its frames."""

from __future__ import annotations

import contextlib
from abc import ABC, abstractmethod
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import VideoError
from taichi_soft.render.ffmpeg import Ffmpeg, count_frames, run_ffmpeg
from taichi_soft.render.opencv import cv2

Frame = NDArray[np.uint8]
Found = tuple[int, set[tuple[int, int]]]
"""Number of frames, and the set of their sizes (width, height)."""

# Colour tags for players. The filter converts the frames to the colours that the tags declare.
COLORS = (
    *("-vf", "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p"),
    *("-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709", "-color_range", "tv"),
)
CODECS = {
    # The index is at the start of the file, so that browsers start playing before the download ends.
    ".mp4": ("-c:v", "libx264", "-preset", "veryfast", "-crf", "18", "-movflags", "+faststart"),
    ".webm": (
        *("-c:v", "libvpx-vp9", "-crf", "24", "-b:v", "0"),
        *("-deadline", "realtime", "-cpu-used", "5", "-row-mt", "1"),
    ),
}
LOSSLESS = ("-c:v", "libx264rgb", "-preset", "ultrafast", "-qp", "0")
# One palette per film and ordered dithering give a still part of the image the same pixels in all frames, so
# that frames compress well and do not flicker.
DITHER = "paletteuse=dither=bayer:bayer_scale=4:diff_mode=rectangle"
GIF_FASTEST = 50.0  # largest frame rate [1/s]; the next possible rate is 100, which viewers play too slowly


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Return a context in which OpenCV prints no messages."""
    before = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(before)


class Container(ABC):
    """A film being written into a temporary folder."""

    @abstractmethod
    def __init__(self, folder: Path, suffix: str, fps: float, size: tuple[int, int]) -> None:
        """Start a film with frames of `size` (width, height). Raises: VideoError or OptionError."""

    @property
    @abstractmethod
    def files(self) -> list[Path]:
        """List the finished files to move to the film's path: one file, or one image per frame."""

    @abstractmethod
    def write(self, frame: Frame) -> None:
        """Add a frame, sRGB (height, width, 3). Raises: VideoError."""

    @abstractmethod
    def finish(self) -> None:
        """Complete the file. Raises: VideoError if the file cannot be completed."""

    @abstractmethod
    def measure(self) -> Found:
        """Read the files back and count their frames. Raises: VideoError for unreadable files."""

    @abstractmethod
    def abandon(self) -> None:
        """Close the file without completing it."""


class Stream(Container):
    """A film in .mp4 (H.264) or .webm (VP9)."""

    def __init__(self, folder: Path, suffix: str, fps: float, size: tuple[int, int]) -> None:
        self._path, self._list = folder / f"film{suffix}", folder / "list"
        self._ffmpeg = Ffmpeg([*_frames_of(fps, size), *COLORS, *CODECS[suffix], self._path])

    @property
    def files(self) -> list[Path]:
        return [self._path]

    def write(self, frame: Frame) -> None:
        self._ffmpeg.write(frame)

    def finish(self) -> None:
        self._ffmpeg.finish()

    def measure(self) -> Found:
        return count_frames(self._path, self._list)

    def abandon(self) -> None:
        self._ffmpeg.kill()


class Gif(Stream):
    """A film in .gif. Frames are stored losslessly on disk until the palette is known."""

    def __init__(self, folder: Path, suffix: str, fps: float, size: tuple[int, int]) -> None:
        if fps > GIF_FASTEST:
            raise VideoError(
                f"a .gif shows at most {GIF_FASTEST:g} frames per second, got {fps:g}: use .webm or .mp4"
            )
        self._frames, self._palette = folder / "frames.mp4", folder / "palette.png"
        self._path, self._list = folder / f"film{suffix}", folder / "list"
        self._ffmpeg = Ffmpeg([*_frames_of(fps, size), *LOSSLESS, self._frames])

    def finish(self) -> None:
        super().finish()
        look = ["-vf", "palettegen=reserve_transparent=0", "-update", "1"]
        run_ffmpeg(["-i", self._frames, *look, self._palette])
        draw = ["-lavfi", DITHER, "-fps_mode", "passthrough", "-loop", "0"]
        run_ffmpeg(["-i", self._frames, "-i", self._palette, *draw, self._path])


class Pictures(Container):
    """Numbered .png images, one per frame."""

    def __init__(self, folder: Path, suffix: str, fps: float, size: tuple[int, int]) -> None:
        self._folder = folder
        self._files: list[Path] = []

    @property
    def files(self) -> list[Path]:
        return self._files

    def write(self, frame: Frame) -> None:
        name = self._folder / f"{len(self._files):04d}.png"
        with quiet():
            is_written = cv2.imwrite(str(name), cv2.cvtColor(frame, cv2.COLOR_RGB2BGR))
        if not is_written:
            raise VideoError(f"OpenCV could not write {name.name}: is the disk full?")
        self._files.append(name)

    def finish(self) -> None:
        """Do nothing, because every image is complete when it is written."""

    def measure(self) -> Found:
        sizes = []
        with quiet():
            for name in self._files:
                picture = cv2.imread(str(name))
                if picture is not None:
                    sizes.append((picture.shape[1], picture.shape[0]))
        return len(sizes), set(sizes)

    def abandon(self) -> None:
        """Do nothing, because no file is open."""


def _frames_of(fps: float, size: tuple[int, int]) -> list[str]:
    """Return the ffmpeg arguments that describe the raw frames in the input pipe of ffmpeg."""
    rate = Fraction(fps).limit_denominator(100_000)
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}"]
    return [*raw, "-r", f"{rate.numerator}/{rate.denominator}", "-i", "pipe:0"]
