"""Make the pictures of the README and the pages: `python docs/make_pictures.py`, in some minutes."""

import tempfile
from pathlib import Path

import cv2
import numpy as np

from taichi_soft.lab.peers import Drop, compare, missing_peers
from taichi_soft.lab.peers.wall import draw_wall
from taichi_soft.render.demos import load_demo
from taichi_soft.render.film import film

FOLDER = Path(__file__).parent / "pictures"
MOMENTS = {"dents": 0.44, "bars": 1.06, "tower": 1.7, "drape": 2.6, "bridge": 1.6, "bowl": 3.0}
"""That show what each demo is about [s]."""


def still(name: str, moment: float, size: tuple[int, int] = (520, 292)) -> np.ndarray:
    """The picture of a demo at a moment, uint8 (height, width, 3)."""
    with tempfile.TemporaryDirectory() as folder:
        film(load_demo(name).stage(), Path(folder) / "f.png", seconds=moment + 0.04, size=size)
        return cv2.imread(str(sorted(Path(folder).iterdir())[-1]))


def main() -> None:
    """Write all pictures."""
    stills = [still(name, moment) for name, moment in MOMENTS.items()]
    rows = [np.hstack(stills[i : i + 2]) for i in range(0, len(stills), 2)]
    cv2.imwrite(str(FOLDER / "demos.png"), np.vstack(rows))
    cv2.imwrite(str(FOLDER / "elephants.png"), still("elephants", 0.52, (1040, 585)))
    cv2.imwrite(str(FOLDER / "laws.png"), still("compare", 0.72, (1040, 585)))
    if not missing_peers():
        drop = Drop()
        cv2.imwrite(str(FOLDER / "peers.png"), draw_wall(drop, compare(drop), 0.92, (1040, 585))[:, :, ::-1])


if __name__ == "__main__":
    main()
