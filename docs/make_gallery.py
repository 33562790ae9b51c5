"""Makes the gallery of the documentation: films and stills of all demos, and the page with bodies to turn.

`python docs/make_gallery.py` makes everything, in some minutes; with names of demos, what belongs to these.
"""

import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from viewer.motion import motion_of
from viewer.page import write_page

from taichi_soft.cli.console import progress_bar, say
from taichi_soft.render.containers import COLORS
from taichi_soft.render.demos import demo_names, load_demo
from taichi_soft.render.ffmpeg import run_ffmpeg
from taichi_soft.render.film import Stage, film

FOLDER = Path(__file__).parent / "gallery"
SIZE, FPS = (480, 270), 25
TURNABLE = ("jelly", "playground", "cloth")
"""Demos on the page with bodies to turn."""

FADE = 10
"""Pictures in which the last one becomes the first again."""

STILLS = {"bounce": 1.3, "elephants": 0.6, "grab": 2.3, "jelly": 0.74, "lod": 3.1, "wheels": 3.0}
"""The moments that their stills show [s]."""

STILL = 0.3
"""Of other films: after which share of it."""

SEEN, CHANGED, LOOK = 24, 0.004, 1.0
"""A picture of which more than this share differs by more levels than that from the last one shows something
that moves. A film ends so long after the last of these [s]."""

CODEC = (
    *("-c:v", "libvpx-vp9", "-crf", "34", "-b:v", "0"),
    *("-deadline", "good", "-cpu-used", "2", "-row-mt", "1"),
)
"""Small files, for which encoding may take its time."""

SIZES = {".webm": 6e6, ".motion": 3e6}
"""What all files of a kind may have together [bytes]: a page is read on the way, too."""

Progress = Callable[[int, int], None]


def write_film(stage: Stage, name: str, on_frame: Progress) -> None:
    """The film of a demo, which leads back into its beginning, and a still."""
    with tempfile.TemporaryDirectory() as scratch:
        film(stage, Path(scratch) / "f.png", fps=FPS, size=SIZE, on_frame=on_frame)
        pictures = [cv2.imread(str(file)) for file in sorted(Path(scratch).iterdir())]
        pictures = pictures[: _end_of(pictures)]
        last = len(pictures) - 1
        still = min(last, round(STILLS[name] * FPS if name in STILLS else STILL * last))
        cv2.imwrite(str(FOLDER / f"{name}.jpg"), pictures[still], [cv2.IMWRITE_JPEG_QUALITY, 82])
        for i in range(FADE):
            fade = _mixed(pictures[-1], pictures[0], (i + 1) / (FADE + 1))
            cv2.imwrite(f"{scratch}/f_{len(pictures) + i:04d}.png", fade)
        frames = ["-framerate", str(FPS), "-i", f"{scratch}/f_%04d.png"]
        count = ["-frames:v", str(len(pictures) + FADE)]
        run_ffmpeg([*frames, *count, *COLORS, *CODEC, f"{scratch}/f.webm"])
        shutil.move(f"{scratch}/f.webm", FOLDER / f"{name}.webm")


def _end_of(pictures: list[NDArray[np.uint8]]) -> int:
    """How many of them there is something to see in."""
    shares = [(cv2.absdiff(each, pictures[-1]).max(axis=2) > SEEN).mean() for each in pictures]
    moving = np.flatnonzero(np.array(shares) > CHANGED)
    return min(len(pictures), int(moving.max(initial=0)) + 1 + round(LOOK * FPS))


def _mixed(one: NDArray[np.uint8], other: NDArray[np.uint8], share: float) -> NDArray[np.uint8]:
    """Some of the other picture over the one."""
    return np.asarray(cv2.addWeighted(one, 1.0 - share, other, share, 0.0), dtype=np.uint8)


def main(names: list[str]) -> None:
    """Make what belongs to these demos."""
    FOLDER.mkdir(exist_ok=True)
    with progress_bar() as bar:
        task = bar.add_task("", total=None)
        for name in names:

            def show(done: int, total: int, name: str = name) -> None:
                bar.update(task, description=name, completed=done, total=total)

            bar.update(task, description=f"{name}: compiling", completed=0, total=None)
            write_film(load_demo(name).stage(), name, show)
            if name in TURNABLE:
                (FOLDER / f"{name}.motion").write_bytes(motion_of(load_demo(name).stage()))
            say(f"{name}: {(FOLDER / f'{name}.webm').stat().st_size / 1e3:.0f} kB")
    motions = [FOLDER / f"{name}.motion" for name in TURNABLE]
    if all(file.is_file() for file in motions):
        write_page(FOLDER / "viewer.html", {file.stem: file.read_bytes() for file in motions})
    for suffix, most in SIZES.items():
        size = sum(file.stat().st_size for file in FOLDER.glob(f"*{suffix}"))
        say(
            f"{suffix}: {size / 1e6:.1f} MB together"
            + (f", above {most / 1e6:.0f} MB" if size > most else "")
        )


if __name__ == "__main__":
    main(sys.argv[1:] or demo_names())
