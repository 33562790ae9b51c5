"""The game in Panda3D plays automatically, off screen: contents of its images."""

import subprocess
import sys

import cv2
import numpy as np
import pytest

from taichi_soft.core.package_data import DEMOS

pytestmark = pytest.mark.soak

pytest.importorskip("panda3d", reason="needs panda3d: pip install 'taichi-soft[panda3d]'")


def picture(path):
    """Red, green and blue, each int (height, width)."""
    return np.moveaxis(cv2.imread(str(path)).astype(int)[:, :, ::-1], 2, 0)


def is_platform(red, green, blue):
    return (blue > 1.7 * red) & (blue > 1.5 * green) & (blue > 100)


def is_block(red, green, blue):
    return (red > 140) & (red > 3 * green) & (red > 3 * blue)


def is_crate(red, green, blue):
    return (red > 1.3 * green) & (green > 1.3 * blue) & (red < 200) & ~is_block(red, green, blue)


def is_toy_cloth(red, green, blue):
    return (blue - red > 20) & (blue - red < 80) & (red > 90) & (abs(2 * green - red - blue) < 30)


def is_level(red, green, blue):
    """Ground, sky and platform: what is left in the half of the toys are toys."""
    ground = (abs(red - 113) < 8) & (abs(green - 138) < 8) & (abs(blue - 113) < 8)
    sky = (abs(red - 204) < 3) & (abs(green - 217) < 3) & (abs(blue - 230) < 3)
    return ground | sky | is_platform(red, green, blue)


def test_a_toy_rides_on_the_platform_one_is_lifted_crates_lie_on_the_block_and_debug_lines_show(tmp_path):
    paths = [tmp_path / f"{number}.png" for number in range(3)]
    command = [sys.executable, str(DEMOS / "panda3d_game.py"), "--headless", *map(str, paths)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stderr
    first, lifted, lined = map(picture, paths)
    for one, other in ((first, lifted), (lifted, lined)):
        assert (abs(one - other).max(axis=0) > 20).mean() > 0.01  # pixels moved
    ends = [np.percentile(np.nonzero(is_platform(*each))[1], (2, 98)) for each in (lifted, lined)]
    assert (ends[1] < ends[0] - 40).all()  # the platform goes to the left
    riders = [np.median(np.nonzero(is_toy_cloth(*each)[250:400, :440])[1]) for each in (lifted, lined)]
    assert riders[1] < riders[0] - 25  # and carries the toy on it

    tops = []
    for each in (first, lifted):
        is_toy = ~is_level(*each)[:550, :420]  # above the line with the keys, left of the block
        assert 0.01 < is_toy.mean() < 0.1
        tops.append(np.nonzero(is_toy)[0].min())
    assert tops[1] < tops[0] - 60
    red, green, blue = lifted
    pink = (red > 120) & (red > green + 20) & (abs(green - blue) < 40)
    assert pink[:400, :420].sum() > 100  # ears and soles in the texture of the grabbed toy
    on_platform = np.nonzero(is_platform(*first))[0].min()
    assert tops[0] < on_platform

    for each in (first, lifted):
        block, crates = np.nonzero(is_block(*each)), np.nonzero(is_crate(*each))
        assert 0.06 < len(block[0]) / each[0].size < 0.2
        assert 0.03 < len(crates[0]) / each[0].size < 0.15
        left, right = np.percentile(crates[1], (1, 99))  # except single pixels on outlines
        assert block[1].min() < left < right < block[1].max()
        lowest = np.percentile(crates[0], 99)
        assert block[0].min() + 20 < lowest < block[0].max() - 60  # they lie on it

    white = [(each.min(axis=0) > 250).sum() for each in (first, lifted, lined)]
    assert max(white[:2]) < 50
    assert white[2] > 2000
