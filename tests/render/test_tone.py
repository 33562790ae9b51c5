"""From light to a screen: in order, without losing black, white and the middle."""

import numpy as np

from taichi_soft.render.colors import to_linear
from taichi_soft.render.tone import KNEE, STEPS, WHITE, encode_table, light_table, tone_map

LIGHT = np.linspace(0.0, WHITE, 20001)


def test_more_light_is_never_darker_and_black_and_white_stay():
    shown = tone_map(LIGHT)
    assert (np.diff(shown) > -1e-7).all()
    assert (np.diff(tone_map(LIGHT[:10001:50])) > 0.0).all()  # strictly, up to half of white
    assert shown[0] == 0.0
    assert shown[-1] == 1.0
    np.testing.assert_array_equal(tone_map(np.array([-3.0, 1e9])), [0.0, 1.0])


def test_the_middle_keeps_its_light_and_bright_light_is_pressed_together():
    middle = np.linspace(0.15, KNEE, 50)
    np.testing.assert_allclose(tone_map(middle), middle, rtol=0.07)
    dark = np.array([0.002, 0.01])
    assert (tone_map(dark) < 0.6 * dark).all()
    one, two = tone_map(np.array([1.0, 2.0]))
    assert 0.75 < one < 0.9
    assert one + 0.05 < two < 1.0


def test_the_curve_has_no_corner():
    """Above the toe its slope changes little from one place to the next, at the knee too."""
    above = LIGHT[LIGHT > 0.05]
    slope = np.diff(tone_map(above).astype(float)) / np.diff(above)
    smooth = np.convolve(slope, np.ones(25) / 25, mode="valid")
    assert np.abs(np.diff(smooth)).max() < 0.005


def test_the_table_holds_the_curve_at_even_steps_of_the_root_of_light():
    table = encode_table()
    assert table.shape == (STEPS,)
    roots = np.array([0, 7, 300, 1500, STEPS - 1])
    light = WHITE * (roots / (STEPS - 1)) ** 2
    np.testing.assert_allclose(to_linear(table[roots] / 255.0), tone_map(light), atol=1e-5)
    assert np.diff(table).max() < 0.5  # no step is visible


def test_light_of_a_byte_is_shown_as_that_byte():
    table, root = encode_table(), np.sqrt(light_table() / WHITE)
    np.testing.assert_allclose(np.interp(root, np.linspace(0, 1, STEPS), table), np.arange(256), atol=0.02)
