"""Pictures averaged to one: by light, not by the numbers of pixels."""

import numpy as np
import pytest

from taichi_soft.render.motion_blur import SHUTTER, mean_picture, shutter_times


def test_the_mean_of_the_same_picture_is_that_picture():
    levels = np.arange(256, dtype=np.uint8)
    picture = np.stack([levels, levels[::-1], np.roll(levels, 100)], axis=1).reshape(16, 16, 3)
    for count in (1, 2, 3, 7, 16):
        np.testing.assert_array_equal(mean_picture([picture.copy() for _ in range(count)]), picture)


def test_half_of_the_light_of_white_is_level_188():
    black, white = np.zeros((2, 2, 3), np.uint8), np.full((2, 2, 3), 255, np.uint8)
    np.testing.assert_array_equal(mean_picture([black, white]), np.full((2, 2, 3), 188))


@pytest.mark.parametrize("pictures", [1, 2, 5, 64])
def test_the_shutter_is_open_at_the_end_of_the_frame(pictures):
    times = np.cumsum(shutter_times(pictures))
    assert len(times) == pictures
    assert times[-1] == pytest.approx(1.0)
    if pictures > 1:
        assert times[0] == pytest.approx(1.0 - SHUTTER)
        np.testing.assert_allclose(np.diff(times), SHUTTER / (pictures - 1))
