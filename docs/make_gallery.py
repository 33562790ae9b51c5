"""Make the films of all demos for the gallery of the documentation.

`python docs/make_gallery.py` makes all films, which takes minutes. With names of demos, the script makes only
the films of these demos. A demo that needs a missing package is skipped, with a message. `make_pictures.py`
makes the stills, `make_worlds.py` the playable worlds.
"""

import argparse
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from rich.markup import escape

from taichi_soft.cli.console import filming, say
from taichi_soft.cli.filming import size_of
from taichi_soft.core.errors import MissingExtraError
from taichi_soft.render.containers import COLORS
from taichi_soft.render.demos import demo_names, load_demo
from taichi_soft.render.ffmpeg import run_ffmpeg
from taichi_soft.render.film import Stage, film

FOLDER = Path(__file__).parent / "gallery"
SIZE, FPS = (480, 270), 25

FADE = 10
"""Number of frames of the cross-fade from the end of a film to its beginning."""

SEEN, CHANGED, LOOK = 24, 0.004, 1.0
"""A frame shows motion if more than the fraction `CHANGED` of its pixels differ by more than `SEEN` levels (0
to 255) from the last frame of the simulation. A film ends `LOOK` [s] after the last frame that shows
motion."""

CODEC = (
    *("-c:v", "libvpx-vp9", "-crf", "34", "-b:v", "0"),
    *("-deadline", "good", "-cpu-used", "2", "-row-mt", "1"),
)
"""Options of ffmpeg that make small files. Encoding may be slow."""

MOST = 6e6
"""Largest total size of all films [bytes]. The limit is for readers with a mobile connection."""

Progress = Callable[[int, int], None]


def write_film(stage: Stage, name: str, on_frame: Progress, size: tuple[int, int] = SIZE) -> None:
    """Write the film of a demo. The end of the film fades into its beginning, so that the film can loop."""
    with tempfile.TemporaryDirectory() as scratch:
        film(stage, Path(scratch) / "f.png", fps=FPS, size=size, on_frame=on_frame)
        pictures = [cv2.imread(str(file)) for file in sorted(Path(scratch).iterdir())]
        pictures = pictures[: _end_of(pictures)]
        for i in range(FADE):
            fade = _mixed(pictures[-1], pictures[0], (i + 1) / (FADE + 1))
            cv2.imwrite(f"{scratch}/f_{len(pictures) + i:04d}.png", fade)
        frames = ["-framerate", str(FPS), "-i", f"{scratch}/f_%04d.png"]
        count = ["-frames:v", str(len(pictures) + FADE)]
        run_ffmpeg([*frames, *count, *COLORS, *CODEC, f"{scratch}/f.webm"])
        shutil.move(f"{scratch}/f.webm", FOLDER / f"{name}.webm")


def _end_of(pictures: list[NDArray[np.uint8]]) -> int:
    """Return the number of frames to show, up to `LOOK` after the last motion."""
    shares = [(cv2.absdiff(each, pictures[-1]).max(axis=2) > SEEN).mean() for each in pictures]
    moving = np.flatnonzero(np.array(shares) > CHANGED)
    return min(len(pictures), int(moving.max(initial=0)) + 1 + round(LOOK * FPS))


def _mixed(one: NDArray[np.uint8], other: NDArray[np.uint8], share: float) -> NDArray[np.uint8]:
    """Blend two images. `share` is the weight of `other`, from 0 to 1."""
    return np.asarray(cv2.addWeighted(one, 1.0 - share, other, share, 0.0), dtype=np.uint8)


def main() -> None:
    """Make the films of the demos that are named, or of all demos."""
    options = argparse.ArgumentParser(description="Film the demos for the gallery of the documentation.")
    options.add_argument("names", nargs="*", metavar="NAME", help="a demo; all of them by default")
    options.add_argument("--seconds", type=float, help="shows at most this much of each demo")
    options.add_argument("--size", default="x".join(map(str, SIZE)), help="of the films, in pixels")
    given = options.parse_args()
    size, names = size_of(given.size), given.names or demo_names()
    FOLDER.mkdir(exist_ok=True)

    def stage_of(name: str) -> Stage:
        stage = load_demo(name).stage()
        stage.seconds = min(stage.seconds, given.seconds or stage.seconds)
        return stage

    for number, name in enumerate(names, start=1):
        try:
            with filming(f"{name}, {number} of {len(names)}") as show:
                write_film(stage_of(name), name, show, size)
        except MissingExtraError as error:
            say(f"{name}: skipped. {escape(str(error))}")
            continue
        say(f"{name}: {(FOLDER / f'{name}.webm').stat().st_size / 1e3:.0f} kB")
    total = sum(file.stat().st_size for file in FOLDER.glob("*.webm"))
    say(f"films: {total / 1e6:.1f} MB together" + (f", above {MOST / 1e6:.0f} MB" if total > MOST else ""))


if __name__ == "__main__":
    main()
