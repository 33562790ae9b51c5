"""Text on pictures: inside, legible, refused."""

import numpy as np
import pytest

from taichi_soft.core.errors import OptionError
from taichi_soft.render import Corner, draw_labels, draw_text

LINES = ["t = 1.24 s", "frame 1.8 ms", "9.3 x real time"]


def gray(width, height):
    return np.full((height, width, 3), 150, dtype=np.uint8)


def changed(picture):
    rows, columns = np.nonzero((picture != 150).any(axis=2))
    return rows.min(), rows.max(), columns.min(), columns.max()


@pytest.mark.parametrize("size", [(1280, 720), (320, 180), (180, 320), (64, 48), (17, 400)])
@pytest.mark.parametrize("corner", list(Corner))
def test_panel_lies_in_its_corner_with_all_ink_inside(size, corner):
    picture = draw_text(gray(*size), LINES, corner=corner)
    top, bottom, left, right = changed(picture)
    width, height = size
    margin = round(0.02 * min(size))
    assert (top == margin) if "top" in corner.value else (bottom == height - 1 - margin)
    assert (left == margin) if "left" in corner.value else (right == width - 1 - margin)
    panel = picture[top : bottom + 1, left : right + 1]
    if min(size) >= 180:
        ink = (panel > 200).all(axis=2)
        assert ink.any()
        # Nothing bright on the rim: no letter is cut off.
        for rim in (ink[0], ink[-1], ink[:, 0], ink[:, -1]):
            assert not rim.any()


def test_letters_grow_with_the_picture():
    heights = []
    for size in ((640, 360), (1280, 720)):
        top, bottom, _, _ = changed(draw_text(gray(*size), LINES))
        heights.append(bottom - top)
    assert heights[1] == pytest.approx(2 * heights[0], rel=0.1)


def test_a_long_line_shrinks_until_it_fits():
    picture = draw_text(gray(320, 180), ["word " * 16])
    _, _, left, right = changed(picture)
    assert 0 < left < right < 320


def test_contrast_on_bright_and_dark_pictures():
    for level in (0, 255):
        picture = draw_text(np.full((360, 640, 3), level, np.uint8), LINES)
        panel = picture[10:40, 10:120].astype(int)
        assert panel.max() - panel.min() > 120


def test_no_lines_draw_nothing():
    np.testing.assert_array_equal(draw_text(gray(64, 48), []), gray(64, 48))


def test_labels_are_centred_below_and_stay_inside():
    picture = draw_labels(gray(640, 360), ["virial"], [(300.0, 100.0)])
    top, bottom, left, right = changed(picture)
    assert (left + right) / 2 == pytest.approx(300, abs=2)
    assert 100 < top < bottom < 140
    for place in ((0.0, 0.0), (639.0, 359.0), (-500.0, 900.0)):
        picture = draw_labels(gray(640, 360), ["a longer label"], [place])
        top, bottom, left, right = changed(picture)
        assert right - left > 50


def test_labels_of_places_without_a_pixel_are_left_out():
    picture = draw_labels(gray(640, 360), ["x"], [(np.nan, np.nan, -1.0)])
    np.testing.assert_array_equal(picture, gray(640, 360))


def test_bad_arguments_are_refused():
    with pytest.raises(OptionError, match="corner"):
        draw_text(gray(64, 48), LINES, corner="middle")
    with pytest.raises(OptionError, match="ASCII"):
        draw_text(gray(64, 48), ["2 µs"])
    with pytest.raises(OptionError, match="list"):
        draw_text(gray(64, 48), "one line")
    with pytest.raises(OptionError, match="picture"):
        draw_text(np.zeros((48, 64), np.uint8), LINES)
    with pytest.raises(OptionError, match="picture"):
        draw_text(np.zeros((48, 64, 3)), LINES)
    with pytest.raises(OptionError, match="places"):
        draw_labels(gray(64, 48), ["a", "b"], [(1.0, 2.0)])
