"""Make the pictures of the README and the pages, and the stills of the gallery.

`python docs/make_pictures.py` makes all pictures, which takes minutes. With names of demos or of playable
scenes, such as `play/jelly`, it makes only their stills.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import gallery_hooks
import numpy as np
from play import scenes

from engine_adapter import FixedStep
from lab.peers import Drop, compare, missing_peers
from lab.peers.wall import draw_wall
from taichi_soft.core.package_data import ASSETS
from taichi_soft.render.demos import demo_names, load_demo
from taichi_soft.render.film import Actor, Stage, film
from taichi_soft.render.props import Prop

FOLDER = Path(__file__).parent / "pictures"
MOMENTS = {"dents": 0.44, "bars": 1.06, "tower": 1.7, "drape": 2.6, "bridge": 1.6, "bowl": 3.0}
"""Simulated time at which the picture `demos.png` shows each demo [s]."""

STILLS = {
    "bounce": 1.3,
    "elephants": 0.6,
    "flag": 3.4,
    "grab": 2.3,
    "jelly": 0.74,
    "lod": 3.1,
    "walk": 4.0,
    "wheels": 3.0,
}
"""Simulated time at which the gallery's still shows each of these demos [s]."""

PLAYED = {
    "jelly": 0.3,
    "bowl": 1.2,
    "elephant": 0.9,
    "flag": 1.6,
    "tower": 0.5,
    "stiffness": 0.75,
    "hand": 0.2,
}
"""Simulated time at which the still shows each playable scene [s]."""

STILL = 0.3
"""Time of the still of a demo that is not in `STILLS`, as a fraction of the demo's length."""

STRIP = (4, 6, 8, 14)
"""Indices of the film's frames that the page about films shows. The film has 20 FPS."""

STILL_SIZE, QUALITY = (480, 270), 82
"""Width and height of the gallery's stills [pixels], and JPEG quality. A still has about 20 kB."""


def still(name: str, moment: float | None, size: tuple[int, int] = (520, 292)) -> np.ndarray:
    """Draw a demo at a moment [s]; None chooses `STILL`. Returns: uint8 (height, width, 3)."""
    stage = load_demo(name).stage()
    return still_of(stage, STILL * stage.seconds if moment is None else moment, size)


def still_of(stage: Stage, moment: float, size: tuple[int, int]) -> np.ndarray:
    """Draw a stage at a moment [s]. Returns: uint8 (height, width, 3)."""
    film(stage, None, seconds=moment)  # simulates without drawing
    with tempfile.TemporaryDirectory() as folder:
        film(stage, Path(folder) / "f.png", fps=50, seconds=0.02, size=size)
        return cv2.imread(f"{folder}/f_0000.png")


def write_still(name: str) -> None:
    """Write the still of a demo for the gallery."""
    file = FOLDER / "demos" / f"{name}.jpg"
    file.parent.mkdir(exist_ok=True)
    cv2.imwrite(str(file), still(name, STILLS.get(name), STILL_SIZE), [cv2.IMWRITE_JPEG_QUALITY, QUALITY])


def write_played_still(name: str) -> None:
    """Write the still of a playable scene for the gallery."""
    made = vars(scenes)[name]()
    actors = [Actor(body, made.colors[body.index]) for body in made.world.bodies]
    props = [Prop(surface, frame) for frame, surface in made.props.items()]
    (title,) = [each.title for each in gallery_hooks.scenes() if each.name == name]
    stage = Stage(title, made.world, actors, made.camera, FixedStep(1 / 60), 5.0, props=props)
    file = FOLDER / "play" / f"{name}.jpg"
    file.parent.mkdir(exist_ok=True)
    cv2.imwrite(str(file), still_of(stage, PLAYED[name], STILL_SIZE), [cv2.IMWRITE_JPEG_QUALITY, QUALITY])


def write_strip() -> None:
    """Write a strip of frames from the film that `taichi-soft film` makes of the elephant."""
    with tempfile.TemporaryDirectory() as folder:
        options = ["--out", f"{folder}/f.png", "--seconds", "1", "--fps", "20", "--size", "480x270"]
        command = [sys.executable, "-m", "taichi_soft", "film", str(ASSETS / "elephant.glb"), *options]
        subprocess.run(command, check=True)
        frames = [cv2.imread(f"{folder}/f_{number:04d}.png")[55:245, 90:390] for number in STRIP]
    cv2.imwrite(str(FOLDER / "film.jpg"), np.hstack(frames), [cv2.IMWRITE_JPEG_QUALITY, QUALITY])


def main(names: list[str]) -> None:
    """Write the stills with these names, or all pictures if there are no names."""
    for name in names or [*demo_names(), *(f"play/{each}" for each in PLAYED)]:
        scene = name.removeprefix("play/")
        write_still(name) if scene == name else write_played_still(scene)
    if names:
        return
    stills = [still(name, moment) for name, moment in MOMENTS.items()]
    rows = [np.hstack(stills[i : i + 2]) for i in range(0, len(stills), 2)]
    cv2.imwrite(str(FOLDER / "demos.png"), np.vstack(rows))
    cv2.imwrite(str(FOLDER / "elephants.png"), still("elephants", 0.52, (1040, 585)))
    cv2.imwrite(str(FOLDER / "laws.png"), still("compare", 0.72, (1040, 585)))
    write_strip()
    if not missing_peers():
        drop = Drop()
        cv2.imwrite(str(FOLDER / "peers.png"), draw_wall(drop, compare(drop), 0.92, (1040, 585))[:, :, ::-1])


if __name__ == "__main__":
    main(sys.argv[1:])
