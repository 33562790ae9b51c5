"""One small drop in every engine: laws of nature that hold for all engines."""

import sys
from functools import cache

import numpy as np
import pytest

from lab.extras import how_to_install, missing_packages
from lab.peers import PEERS, Drop, measure
from lab.peers.ours import simulate
from lab.peers.reference import simulate_reference
from lab.peers.trajectory import RATE
from taichi_soft import sphere

pytestmark = pytest.mark.soak

DROP = Drop(mesh=sphere(0.5, 2), height=0.4, seconds=0.8)
TOUCH = np.sqrt(2 * DROP.height / 9.81)
ENGINES = {"taichi-soft": simulate, "reference": simulate_reference, **{p.name: p.simulate for p in PEERS}}
MODULES = {peer.name: peer.module for peer in PEERS}


def has_no_wheel(module):
    """PyBullet has wheels up to Python 3.11. With later versions, its tests need an existing installation."""
    return module == "pybullet" and sys.version_info >= (3, 12) and bool(missing_packages("peers", module))


@cache
def trajectory_of(name):
    return ENGINES[name](DROP, None)


@pytest.fixture(params=[name for name in ENGINES if not has_no_wheel(MODULES.get(name))])
def trajectory(request):
    module = MODULES.get(request.param)
    if module and missing_packages("peers", module):
        pytest.skip(f"needs {module}: {how_to_install('peers')}")
    return trajectory_of(request.param)


def test_all_vertices_start_where_the_drop_has_them_in_its_order(trajectory):
    np.testing.assert_allclose(trajectory.positions[0], DROP.start, atol=1e-6)
    assert trajectory.positions.shape == (round(DROP.seconds * RATE) + 1, len(DROP.mesh.vertices), 3)


def test_a_body_falls_by_half_g_t_squared_without_a_change_of_shape_until_it_touches(trajectory):
    """Euler's methods are ahead or behind by half a step."""
    count = int(TOUCH * RATE)
    t = np.arange(count) / RATE
    fallen = trajectory.positions[0, :, 2] - trajectory.positions[:count, :, 2]
    late = 9.81 * t * trajectory.step / 2
    np.testing.assert_allclose(fallen.mean(axis=1), 9.81 / 2 * t**2, rtol=1e-4, atol=1e-3 + late.max())
    np.testing.assert_allclose(fallen, np.broadcast_to(fallen.mean(axis=1)[:, None], fallen.shape), atol=1e-3)


@pytest.mark.guard
def test_a_body_lands_on_the_floor_and_neither_floats_above_it_nor_sinks_in(trajectory):
    lowest = trajectory.positions[:, :, 2].min()
    assert -0.04 < lowest < 0.005


def test_a_body_falls_straight_down_and_up_again(trajectory):
    sideways = trajectory.positions[:, :, :2].mean(axis=1)
    assert np.abs(sideways - sideways[0]).max() < 0.02


def test_a_body_is_squashed_as_in_the_reference_and_bounces_no_higher_than_it_fell_from(trajectory):
    """To a third; what is left is what the comparison is about."""
    outcome, exact = measure(DROP, trajectory), measure(DROP, trajectory_of("reference"))
    assert outcome.squash == pytest.approx(exact.squash, rel=1 / 3)
    assert exact.bounce / 2 < outcome.bounce < 1.05


@pytest.mark.skipif(bool(missing_packages("peers", "mujoco")), reason="needs mujoco: the extra peers")
def test_mujoco_leaves_no_file_where_it_is_called(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    ENGINES["MuJoCo, explicit"](DROP, None)
    assert list(tmp_path.iterdir()) == []


def test_each_frame_has_its_time(trajectory):
    assert len(trajectory.frame_times) == round(DROP.seconds * 60)
    assert (trajectory.frame_times > 0).all()
