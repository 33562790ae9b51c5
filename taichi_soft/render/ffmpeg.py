"""Run ffmpeg in a separate process, to isolate the crashes and the licence of ffmpeg."""

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
    """Return the path of ffmpeg: $IMAGEIO_FFMPEG_EXE, or the program in the package imageio-ffmpeg.

    Raises: MissingExtraError without this package; VideoError if the package has no ffmpeg for this system.
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
    """A running ffmpeg that receives frames.

    ffmpeg reads the frames from a pipe. When this process ends for any reason, the pipe closes and ffmpeg
    ends too. Ctrl-C in a terminal interrupts this process, but not ffmpeg. ffmpeg inherits the priority of
    this process.
    """

    def __init__(self, arguments: Sequence[str | Path]) -> None:
        """Start ffmpeg with the options `QUIET` and `arguments`.

        Raises: VideoError if ffmpeg does not start, and the errors of `find_ffmpeg`.
        """
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
        """Send a frame. Raises: VideoError if ffmpeg has ended."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(np.ascontiguousarray(frame).data)
        except OSError:
            self._process.wait()
            raise VideoError(f"ffmpeg ended: {self._complaint()}") from None

    def finish(self) -> None:
        """Close the pipe and wait for ffmpeg to end. Raises: VideoError if it failed."""
        try:
            with contextlib.suppress(OSError):  # ffmpeg has already ended; its exit code is checked below
                self._process.communicate()
            if self._process.returncode != 0:
                raise VideoError(f"ffmpeg failed: {self._complaint()}")
        finally:
            self.kill()

    def kill(self) -> None:
        """Kill ffmpeg if it is running."""
        self._process.kill()
        with contextlib.suppress(OSError):  # ffmpeg has not read all frames
            self._process.communicate()
        self._complaints.close()

    def _complaint(self) -> str:
        """Return the last line of ffmpeg's error output."""
        self._complaints.seek(0)
        lines = self._complaints.read().decode(errors="replace").split("\n")
        said = [line.strip() for line in lines if line.strip()]
        return said[-1] if said else f"exit code {self._process.returncode}"


def run_ffmpeg(arguments: Sequence[str | Path]) -> None:
    """Run ffmpeg with these arguments until it ends. Raises: VideoError, and the errors of `find_ffmpeg`."""
    Ffmpeg(arguments).finish()


def count_frames(path: Path, list_file: Path) -> tuple[int, set[tuple[int, int]]]:
    """Count the decodable frames of a film, and collect their sizes (width, height).

    Args:
        list_file: path for ffmpeg's list of frames, one line each.
    Raises: VideoError for a file that is not a film, and the errors of `find_ffmpeg`.
    """
    run_ffmpeg(["-i", path, "-map", "0:v:0", "-fps_mode", "passthrough", "-f", "framecrc", list_file])
    lines = list_file.read_text().splitlines()
    sizes = [line.split()[-1].split("x") for line in lines if line.startswith("#dimensions")]
    count = sum(not line.startswith("#") for line in lines)
    return count, {(int(width), int(height)) for width, height in sizes}
