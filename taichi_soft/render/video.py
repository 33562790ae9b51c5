"""Write films and verify them."""

from __future__ import annotations

import re
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.checks import as_count, as_number, as_path
from taichi_soft.core.errors import StateError, VideoError
from taichi_soft.core.part_folder import PartFolder
from taichi_soft.render.containers import Container, Gif, Pictures, Stream

CONTAINERS: dict[str, type[Container]] = {".mp4": Stream, ".webm": Stream, ".gif": Gif, ".png": Pictures}


class VideoWriter:
    """Context manager that writes frames to a film. The suffix of `path` chooses the format.

    Args:
        path: .mp4 (H.264), .webm (VP9), .gif, or .png for numbered images: `out/bounce.png` gives
            `out/bounce_0000.png` and so on. Browsers play all formats. A missing folder is created.
        fps: frames per second, above 0 to 240; at most 50 for .gif.
        size: (width, height) of the frames [pixels], both even for .webm and .mp4.
    Raises: VideoError for a suffix, size or path that cannot be written; OptionError for other wrong
        arguments, and if the package with ffmpeg is missing (.png does not need it).

    The film is written to a hidden folder next to `path`, read back, and moved to `path` only if it has every
    frame. After an exception inside the `with` block, an earlier film at `path` is unchanged. If the process
    is killed, the next film in the same folder removes the hidden folder. Images that remain from a longer
    sequence of the same name are removed.
    """

    def __init__(self, path: str | Path, *, fps: float, size: tuple[int, int]) -> None:
        self.path = as_path(path)
        suffix = self.path.suffix.lower()
        if suffix not in CONTAINERS or not self.path.stem:
            raise VideoError(f"cannot write {str(path)!r}: name a file that ends in {', '.join(CONTAINERS)}")
        self.fps = as_number(fps, "fps", 1e-3, 240.0)
        if not isinstance(size, (tuple, list)) or len(size) != 2:
            raise VideoError(f"size must be (width, height), got {size!r}")
        self.size = as_count(size[0], "width", 2, 16384), as_count(size[1], "height", 2, 16384)
        if CONTAINERS[suffix] is Stream and (self.size[0] % 2 or self.size[1] % 2):
            raise VideoError(f"a {suffix} film needs an even width and height, got {size[0]} x {size[1]}")
        self.count = 0  # number of frames written
        self._closed = False
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            if self.path.is_dir():
                raise IsADirectoryError(21, "it is a folder")
            self._part = PartFolder(self.path.parent)
        except OSError as error:
            raise VideoError(f"cannot write {self.path}: {error.strerror or error}") from error
        try:
            self._container = CONTAINERS[suffix](self._part.path, suffix, self.fps, self.size)
        except BaseException:
            self._part.remove()
            raise

    def write(self, frame: NDArray[np.uint8]) -> None:
        """Add a frame.

        Args:
            frame: sRGB, uint8 (height, width, 3).
        Raises: VideoError for other shapes or types; StateError after `close`.
        """
        if self._closed:
            raise StateError(f"{self.path} is closed: no frame can be added")
        wanted = (self.size[1], self.size[0], 3)
        given: Any = frame
        if not isinstance(given, np.ndarray) or given.shape != wanted or given.dtype != np.uint8:
            what = (
                f"{given.dtype} of shape {given.shape}"
                if isinstance(given, np.ndarray)
                else type(given).__name__
            )
            raise VideoError(f"frame {self.count} must be uint8 of shape {wanted}, got {what}")
        try:
            self._container.write(frame)
        except BaseException:  # the film may contain an incomplete frame
            self._give_up()
            raise
        self.count += 1

    def close(self) -> None:
        """Complete the film, verify it and move it to `path`. Further calls do nothing.

        Raises: VideoError if there is no frame or a frame is missing. In this case no file is left behind.
        """
        if self._closed:
            return
        try:
            if self.count == 0:
                raise VideoError(f"no frame was written to {self.path}: nothing was saved")
            self._container.finish()
            found, sizes = self._container.measure()
            if found != self.count or sizes != {self.size}:
                raise VideoError(
                    f"{self.path} would hold {found} frames of size {sorted(sizes)} instead of "
                    f"{self.count} of {self.size}: is the disk full?"
                )
            self._move()
        except OSError as error:
            if isinstance(error, VideoError):
                raise
            raise VideoError(f"cannot write {self.path}: {error.strerror or error}") from error
        finally:
            self._give_up()

    def __enter__(self) -> VideoWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self._give_up()

    def _give_up(self) -> None:
        """Discard the unfinished files. Further calls do nothing."""
        if not self._closed:
            self._closed = True
            self._container.abandon()
            self._part.remove()

    def _move(self) -> None:
        """Move the finished film to its path."""
        files = self._container.files
        if self.path.suffix.lower() != ".png":
            files[0].replace(self.path)
            return
        for picture in files:
            picture.replace(self.path.with_name(f"{self.path.stem}_{picture.name}"))
        numbered = re.compile(re.escape(self.path.stem) + r"_(\d{4,})\.png")
        for name in self.path.parent.iterdir():
            match = numbered.fullmatch(name.name)
            if match and int(match.group(1)) >= self.count:
                name.unlink()
