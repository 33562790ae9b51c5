"""Scenes of contact: their measures against closed forms, and a run of two of them."""

import numpy as np
import pytest
from typer.testing import CliRunner

from lab.cli.app import app
from lab.contact import SCENES, run_scene
from lab.contact.criteria import Finally, Most
from lab.contact.encounters import Arena
from lab.contact.geometry import depth_in, segment_distances
from lab.contact.page import markdown
from taichi_soft import Material, World, box

RUBBER = Material(young=1e6, poisson=0.4, density=1000.0)


def test_depth_of_points_in_a_cube_is_the_distance_from_its_nearest_side():
    world = World(floor=None)
    cube = world.add_body(box((0.4, 0.4, 0.4), (2, 2, 2)), RUBBER)
    world.build()
    points = np.array([[0.0, 0.0, 0.15], [0.19, 0.1, -0.1], [0.3, 0.0, 0.0]])
    assert depth_in(cube, points) == pytest.approx(0.05, abs=1e-6)
    assert depth_in(cube, points[1:]) == pytest.approx(0.01, abs=1e-6)
    assert depth_in(cube, points[2:]) == 0.0


def test_distance_of_segments_is_the_least_of_a_fine_grid():
    rng = np.random.default_rng(3)
    p, q, r, s = rng.normal(size=(4, 30, 3))
    t = np.linspace(0.0, 1.0, 301)
    first = p[:, None] + t[:, None] * (q - p)[:, None]
    second = r[:, None] + t[:, None] * (s - r)[:, None]
    least = np.linalg.norm(first[:, :, None] - second[:, None], axis=3).min(axis=(1, 2))
    found = segment_distances(p, q, r, s)
    assert (found <= least + 1e-9).all()
    assert found == pytest.approx(least, abs=0.02)


def test_a_criterion_fails_for_values_beyond_its_limit_and_for_nan():
    values = iter([1.0, 3.0, 2.0])
    most = Most("size", lambda: next(values), 2.5, "m")
    for time in range(3):
        most.measure(time)
    assert most.result() == ("3 m", False)
    nan = Most("size", lambda: float("nan"), 2.5, "m")
    nan.measure(0.0)
    assert not nan.result()[1]
    assert not Finally("size", lambda: float("nan"), 0.0, 1.0, "m").result()[1]


@pytest.mark.soak
@pytest.mark.guard
def test_bars_and_ropes_hold_each_other_and_the_page_says_so():
    outcomes = [each for name in ("thrown bar", "rope over rope") for each in run_scene(SCENES[name])]
    assert all(each.is_met for each in outcomes), outcomes
    page = markdown(outcomes)
    assert "2 of 2 scenes meet all criteria" in page
    assert page.count("| holds |") == len(outcomes)


@pytest.mark.soak
@pytest.mark.guard
def test_bodies_that_meet_at_1_to_200_m_per_s_stay_apart_keep_momentum_and_gain_no_energy():
    arena = Arena()
    found = [arena.meet(seed) for seed in range(60)]
    assert [each for each in found if not each.is_good] == []
    assert all(each.have_met for each in found)
    assert max(each.speed for each in found) > 150.0


@pytest.mark.soak
@pytest.mark.needs("film")
def test_a_scene_can_be_filmed(tmp_path):
    done = CliRunner().invoke(app, ["contact", "wall at 30 m/s", "--films", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "wall-at-30-m-s.mp4").stat().st_size > 1000
