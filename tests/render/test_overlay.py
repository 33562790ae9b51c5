"""Text on pictures: inside, legible, refused."""

import numpy as np
import pytest

from taichi_soft.core.errors import OptionError
from taichi_soft.render import ColorScale, Corner, draw_color_scale, draw_labels, draw_legend, draw_text

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


@pytest.mark.parametrize("corner", list(Corner))
@pytest.mark.parametrize("size", [(1280, 720), (480, 270), (64, 48)])
def test_a_color_bar_runs_from_the_low_color_to_the_high_one_inside_its_panel(size, corner):
    scale = ColorScale("von Mises stress", 0.0, 2e5, "Pa")
    picture = draw_color_scale(gray(*size), scale, corner=corner)
    top, bottom, left, right = changed(picture)
    margin = round(0.02 * min(size))
    assert margin <= top < bottom <= size[1] - 1 - margin
    assert margin <= left < right <= size[0] - 1 - margin
    ends = np.round(255 * scale.colors([0.0, 2e5])).astype(int)
    reds = [(np.abs(picture.astype(int) - end).max(axis=2) < 3).nonzero()[1] for end in ends]
    assert reds[0].mean() < (left + right) / 2 < reds[1].mean()


def test_the_ends_of_a_scale_are_told_in_a_unit_that_suits():
    for low, high, unit, told in (
        (0.0, 2e5, "Pa", ("0", "200 kPa")),
        (-3e7, 3e7, "Pa", ("-30", "30 MPa")),
        (200.0, 2000.0, "kg/m^3", ("200", "2000 kg/m^3")),
        (0.0, 0.5, "m", ("0", "0.5 m")),
    ):
        assert ColorScale("x", low, high, unit).ticks() == told


def test_colors_of_a_scale_are_bright_and_stop_at_its_ends():
    """Shadow has to show on every one: viridis begins with a luminance of 0.02."""
    scale = ColorScale("x", 1.0, 3.0, "m")
    rows = scale.colors(np.linspace(1.0, 3.0, 101)).astype(float)
    linear = np.where(rows <= 0.04045, rows / 12.92, ((rows + 0.055) / 1.055) ** 2.4)
    assert (linear @ (0.2126, 0.7152, 0.0722)).min() > 0.1
    np.testing.assert_array_equal(scale.colors([-5.0, 9.0]), scale.colors([1.0, 3.0]))


def test_a_legend_shows_each_color_beside_its_words():
    entries = [((1.0, 0.0, 0.0), "red"), ((0.0, 0.0, 1.0), "blue")]
    picture = draw_legend(gray(480, 270), entries, corner="bottom right")
    top, bottom, left, right = changed(picture)
    places = [np.argwhere((picture == np.array(color) * 255).all(axis=2)) for color, _ in entries]
    for place in places:
        assert len(place) > 40
        assert left < place[:, 1].min()
        assert place[:, 1].max() < (left + right) / 2
    assert top < places[0][:, 0].max() < places[1][:, 0].min() < bottom


def test_bad_scales_and_legends_are_refused():
    for options in ((("x", 1.0, 1.0, "m")), ("x\n", 0.0, 1.0, "m"), ("x", 0.0, 1.0, "\u00b5m")):
        with pytest.raises(OptionError):
            ColorScale(*options)
    with pytest.raises(OptionError, match="scale"):
        draw_color_scale(gray(64, 48), "stress")
    with pytest.raises(OptionError, match="color"):
        draw_legend(gray(64, 48), [((2.0, 0.0, 0.0), "x")])
    with pytest.raises(OptionError, match="ASCII"):
        draw_legend(gray(64, 48), [((1.0, 0.0, 0.0), "\u00b5")])
