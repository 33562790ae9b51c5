"""Films: the right number of frames of the right moments, and nothing where it is refused."""

import cv2
import numpy as np
import pytest

from engine_adapter import FixedStep
from taichi_soft import Material, OptionError, VideoError, World, box
from taichi_soft.render import Camera, Renderer
from taichi_soft.render.film import Actor, Stage, film


def falling_box(dt: float = 1 / 50) -> Stage:
    world = World()
    body = world.add_body(box((1, 1, 1), (2, 2, 2)), Material(1e5, 0.2, 1000, 10), position=(0, 0, 4))
    world.build()
    camera = Camera.framing((-1, -1, 0), (1, 1, 5))
    return Stage("box", world, [Actor(body, label="box")], camera, FixedStep(dt=dt), 1.0)


def test_frames_show_every_fixed_step_where_both_rates_agree(tmp_path):
    stage = falling_box()
    seen = []
    report = film(stage, tmp_path / "b.mp4", size=(160, 120), on_frame=lambda *now: seen.append(now))
    assert report.frames == 50
    assert len(report.draw_times) == 48
    assert seen == [(i + 1, 50) for i in range(50)]
    assert stage.world.step_count == 49
    assert report.simulated == pytest.approx(0.98)
    assert int(cv2.VideoCapture(str(report.path)).get(cv2.CAP_PROP_FRAME_COUNT)) == 50


def test_the_time_in_the_picture_is_that_of_the_body_in_it(tmp_path, monkeypatch):
    """In free fall from z0 the lowest point is at z0 - g t^2 / 2 at the time that the panel tells."""
    told, drawn = [], []
    monkeypatch.setattr("taichi_soft.render.film.draw_text", lambda picture, lines: told.append(lines[1]))
    original = Renderer.render

    def watched(self, surfaces):
        drawn.append(surfaces[0].positions[:, 2].min())
        return original(self, surfaces)

    monkeypatch.setattr(Renderer, "render", watched)
    film(falling_box(), tmp_path / "b.png", seconds=0.5, size=(160, 120))
    times = np.array([float(line.split()[2]) for line in told])
    assert times[-1] == pytest.approx(0.46)  # of 0.48 put in: one step behind, to interpolate
    np.testing.assert_allclose(drawn, 3.5 - 0.5 * 9.81 * times**2, atol=1e-5)


def test_the_real_time_factor_is_simulated_time_over_time_taken():
    report = film(falling_box(), None, seconds=0.4)
    assert len(report.step_times) == report.frames - 2
    expected = len(report.step_times) * 0.02 / report.step_times.sum()
    assert report.real_time_factor == pytest.approx(expected)
    assert report.path is None
    assert len(report.draw_times) == 0


def test_the_picture_changes_as_the_body_falls(tmp_path):
    film(falling_box(), tmp_path / "f.png", seconds=0.6, fps=10, size=(160, 120))
    first, last = (cv2.imread(str(tmp_path / f"f_{i:04}.png")) for i in (0, 5))
    assert np.abs(first.astype(int) - last.astype(int)).max() > 60


@pytest.mark.parametrize(
    ("option", "value"),
    [("seconds", 0.0), ("seconds", 1e300), ("seconds", np.nan), ("fps", -5), ("fps", "x")],
)
def test_a_wrong_number_is_refused_before_anything_moves(option, value, tmp_path):
    stage = falling_box()
    with pytest.raises(OptionError, match=option):
        film(stage, tmp_path / "f.mp4", **{option: value})
    assert stage.world.step_count == 0
    assert not list(tmp_path.iterdir())


def test_a_film_of_no_known_kind_is_refused_before_anything_moves(tmp_path):
    stage = falling_box()
    with pytest.raises(VideoError, match="webm"):
        film(stage, tmp_path / "f.xyz")
    assert stage.world.step_count == 0


def test_frames_too_long_for_the_steps_they_may_take_are_refused(tmp_path):
    stage = falling_box()
    with pytest.raises(OptionError, match=r"6\.25 or more"):
        film(stage, None, fps=2)
    assert stage.world.step_count == 0


def test_simulated_time_is_that_of_the_world():
    stage = falling_box(dt=1 / 60)
    report = film(stage, None, seconds=0.5)
    assert report.simulated == stage.world.time > 0.4
