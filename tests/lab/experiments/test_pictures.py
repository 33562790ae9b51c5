"""Images of measured positions: their contents and layout."""

import numpy as np
import pytest

from lab.experiments.pictures import picture
from taichi_soft import OptionError, box

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

SIZE = (160, 120)


@pytest.fixture(scope="module")
def cube():
    return box((1, 1, 1), (2, 2, 2))


def moved(mesh, *shift):
    return mesh.vertices + np.array(shift)


def body_pixels(image):
    """Return True for pixels that show neither sky nor floor. Both are nearly grey."""
    rows = image.astype(int)
    return rows.max(axis=2) - rows.min(axis=2) > 40


def test_a_body_is_wholly_in_the_middle_of_its_picture_and_fills_it(cube):
    for scale, away in ((1.0, 0.0), (1e-3, 7.0), (50.0, -200.0)):
        image = picture([(cube, scale * cube.vertices + away)], False, SIZE)
        assert image.shape == (120, 160, 3)
        assert image.dtype == np.uint8
        down, right = np.nonzero(body_pixels(image))
        assert down.min() > 2
        assert right.min() > 2
        assert down.max() < 117
        assert right.max() < 157
        assert np.ptp(down) > 70
        assert abs(right.mean() - 80) < 12


def test_the_floor_lies_at_zero_and_bodies_above_it_throw_a_shadow(cube):
    empty = picture([(cube, moved(cube, 0, 0, 0.5))], False, SIZE)
    floor = picture([(cube, moved(cube, 0, 0, 0.5))], True, SIZE)
    assert floor[-1].mean() < empty[-1].mean() - 20  # grey tiles instead of the sky
    high = picture([(cube, moved(cube, 0, 0, 3.0))], True, SIZE)
    assert np.nonzero(body_pixels(high))[0].max() < 60  # the floor below it is in the picture too
    sunk = picture([(cube, moved(cube, 0, 0, -0.3))], True, SIZE)
    assert body_pixels(sunk).sum() > 0.9 * body_pixels(floor).sum()  # nothing is hidden by the floor


def test_numbers_run_from_violet_to_yellow_on_one_scale_for_all_bodies(cube):
    height = cube.vertices[:, 2]
    image = picture([(cube, cube.vertices)], False, SIZE, [height]).astype(int)
    inside = body_pixels(image.astype(np.uint8))
    down = np.nonzero(inside)[0]
    top, bottom = (
        image[(np.indices(inside.shape)[0] == row) & inside].mean(axis=0)
        for row in (down.min() + 8, down.max() - 8)
    )
    assert top[0] > top[2] + 60  # yellow: red, no blue
    assert bottom[2] > bottom[1] + 20  # violet: blue, no green
    pair = [(cube, cube.vertices), (cube, moved(cube, 1.5, 0, 0))]
    same = picture(pair, False, SIZE, [np.zeros(27), np.ones(27)])
    again = picture(pair, False, SIZE, [np.full(27, 5.0), np.full(27, 7.0)])
    np.testing.assert_array_equal(same, again)
    fixed = picture(pair, False, SIZE, [np.full(27, 5.0), np.full(27, 7.0)], limits=(0.0, 1.0))
    assert not np.array_equal(fixed, again)


def test_words_stand_in_the_picture(cube):
    pair = [(cube, cube.vertices), (cube, moved(cube, 1.5, 0, 0))]
    plain = picture(pair, False, SIZE, [np.zeros(27)] * 2)
    for words in ({"labels": ("left", "right")}, {"quantity": "strain [1]"}):
        assert not np.array_equal(picture(pair, False, SIZE, [np.zeros(27)] * 2, **words), plain)


def test_what_cannot_be_drawn_is_refused(cube):
    bad = cube.vertices.copy()
    bad[3, 1] = np.nan
    for arguments, said in (
        (([], False), "one body"),
        (([(cube, bad)], False), "finite"),
        (([(cube, cube.vertices[:5])], False), "shape"),
        (([(cube, cube.vertices)], False, SIZE, []), "values of 0"),
    ):
        with pytest.raises(OptionError, match=said):
            picture(*arguments)
