"""The game in Panda3D with Bullet, off screen: contents of its image."""

import subprocess
import sys

import cv2
import numpy as np
import pytest

from taichi_soft.core.package_data import DEMOS

pytestmark = pytest.mark.soak

pytest.importorskip("panda3d", reason="needs panda3d: pip install 'taichi-soft[panda3d]'")


def test_crates_lie_on_the_block_that_they_dent(tmp_path):
    path = tmp_path / "game.png"
    done = subprocess.run(
        [sys.executable, str(DEMOS / "panda3d_bullet.py"), str(path)],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    blue, green, red = np.moveaxis(cv2.imread(str(path)).astype(int), 2, 0)
    block = (red > 100) & (red > 2 * green) & (red > 2 * blue)
    sky = (abs(red - 204) < 8) & (abs(green - 217) < 8) & (abs(blue - 230) < 8)
    crates = (abs(red - green) < 25) & (abs(red - blue) < 40) & ~sky & (red > 30)
    assert 0.15 < block.mean() < 0.5
    assert 0.3 < sky.mean() < 0.8
    assert 0.02 < crates.mean() < 0.2
    rows, columns = np.nonzero(block)
    middle = abs(columns - columns.mean()) < 60
    highest = [rows[(columns == column)].min() for column in np.unique(columns[middle])]
    assert np.ptp(highest) > 5  # its upper edge is not straight, because crates dent it
    assert rows.max() > 500  # it stands in front, on the floor
