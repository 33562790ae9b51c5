"""ffmpeg, in a process of its own: a crash of it is an error here, and its licence stays on its side."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import VideoError
from taichi_soft.core.extras import require_extra

QUIET = ("-hide_banner", "-nostdin", "-nostats", "-v", "error", "-y")


def find_ffmpeg() -> str:
    """Path of the ffmpeg that the package imageio-ffmpeg brings, or that $IMAGEIO_FFMPEG_EXE names.

    Raises: MissingExtraError where that package is missing; VideoError where it has none for this system.
    """
    require_extra("film", "a .mp4, .webm or .gif film needs", "imageio_ffmpeg")
    from imageio_ffmpeg import get_ffmpeg_exe  # type: ignore[import-untyped, import-not-found]

    try:
        return str(get_ffmpeg_exe())
    except RuntimeError:
        raise VideoError(
            "imageio-ffmpeg has no ffmpeg for this system: install one and set IMAGEIO_FFMPEG_EXE to its "
            "path, or write .png pictures"
        ) from None


class Ffmpeg:
    """A run of ffmpeg that takes frames.

    It reads them from a pipe. The pipe ends with this process, however that ends, and ffmpeg with the pipe.
    Ctrl-C of a terminal does not reach it: the process that started it decides. It has the priority of that
    process.
    """

    def __init__(self, arguments: Sequence[str | Path]) -> None:
        """`arguments` stand behind those of `QUIET`. Raises: as `find_ffmpeg`; VideoError."""
        options: dict[str, Any] = {"start_new_session": True}
        if sys.platform == "win32":
            options = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP | subprocess.CREATE_NO_WINDOW}
        command = [find_ffmpeg(), *QUIET, *map(str, arguments)]
        self._complaints = tempfile.TemporaryFile()  # noqa: SIM115
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=self._complaints,
                **options,
            )
        except OSError as error:
            self._complaints.close()
            raise VideoError(f"cannot start {command[0]}: {error.strerror or error}") from error

    def write(self, frame: NDArray[np.uint8]) -> None:
        """Give it a frame. Raises: VideoError where it has ended."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(np.ascontiguousarray(frame).data)
        except OSError:
            self._process.wait()
            raise VideoError(f"ffmpeg ended: {self._complaint()}") from None

    def finish(self) -> None:
        """Say that there are no more frames, and wait for its end. Raises: VideoError where it failed."""
        try:
            with contextlib.suppress(OSError):  # it has ended before: its exit code says how
                self._process.communicate()
            if self._process.returncode != 0:
                raise VideoError(f"ffmpeg failed: {self._complaint()}")
        finally:
            self.kill()

    def kill(self) -> None:
        """End it at once, if it still runs."""
        self._process.kill()
        with contextlib.suppress(OSError):  # what it has not read is lost
            self._process.communicate()
        self._complaints.close()

    def _complaint(self) -> str:
        """The last line that it wrote."""
        self._complaints.seek(0)
        lines = self._complaints.read().decode(errors="replace").split("\n")
        said = [line.strip() for line in lines if line.strip()]
        return said[-1] if said else f"exit code {self._process.returncode}"


def run_ffmpeg(arguments: Sequence[str | Path]) -> None:
    """Run it on files. Raises: as `Ffmpeg`."""
    Ffmpeg(arguments).finish()


def count_frames(path: Path, list_file: Path) -> tuple[int, set[tuple[int, int]]]:
    """How many frames of a film can be decoded, and their size (width, height).

    Args:
        list_file: a place for ffmpeg's list of them, one line each.
    Raises: as `Ffmpeg`; VideoError for a file that is no film.
    """
    run_ffmpeg(["-i", path, "-map", "0:v:0", "-fps_mode", "passthrough", "-f", "framecrc", list_file])
    lines = list_file.read_text().splitlines()
    sizes = [line.split()[-1].split("x") for line in lines if line.startswith("#dimensions")]
    count = sum(not line.startswith("#") for line in lines)
    return count, {(int(width), int(height)) for width, height in sizes}
