"""The comparison of engines: the reference, both measures, the halving of steps, and the film."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from lab import peers
from lab.cli.peers import peers as film_peers
from lab.peers import Drop, Entry, Trajectory, compare, comparison, measure
from lab.peers.drop import GRAVITY
from lab.peers.reference import Reference
from lab.peers.trajectory import RATE, Simulation, record
from lab.peers.wall import captions, film_wall
from taichi_soft import OptionError, StateError, VideoError, box, sphere
from taichi_soft.render import VideoWriter

pytestmark = pytest.mark.soak

SMALL = Drop(mesh=sphere(0.5, 2), height=0.4, seconds=0.8)


def bounced(drop, squash, speed_back):
    """Make a trajectory: free fall, half a sine of squashing in 0.1 s, and a slower rise."""
    t = np.arange(round(drop.seconds * RATE) + 1) / RATE
    touch, contact = np.sqrt(2 * drop.height / GRAVITY), 0.1
    up, speed = t - touch - contact, speed_back * GRAVITY * touch
    height = np.where(t < touch, drop.height - GRAVITY / 2 * t**2, speed * up - GRAVITY / 2 * up**2)
    height[(t >= touch) & (up < 0)] = 0.0
    pressed = np.where((t >= touch) & (up < 0), squash * np.sin(np.pi * (t - touch) / contact), 0.0)
    rest = drop.start - (0, 0, drop.height)
    rows = rest * np.stack([0 * t + 1, 0 * t + 1, 1 - pressed], axis=1)[:, None]
    rows[:, :, 2] += height[:, None]
    return Trajectory(rows, np.full(round(drop.seconds * 60), 1e-3), 1 / RATE)


def test_the_masses_of_vertices_add_up_to_density_times_volume():
    assert SMALL.masses.sum() == pytest.approx(SMALL.density * SMALL.mesh.volume, rel=1e-12)
    assert SMALL.start[:, 2].min() == pytest.approx(SMALL.height)


def test_the_forces_of_the_reference_are_the_gradient_of_its_energy():
    """The reference is central differences for a block that is bent, stretched and rotated."""
    drop = Drop(mesh=box((1, 1, 1), (1, 1, 1)))
    body = Reference(drop, 10)
    rng = np.random.default_rng(1)
    body.positions = body.positions @ np.array([[0, -1.1, 0], [0.9, 0, 0.1], [0, 0, 0.8]])
    body.positions += 0.05 * rng.standard_normal(body.positions.shape)
    forces = body.masses[:, None] * body.accelerations()
    rest = body.positions.copy()
    for place in np.ndindex(*rest.shape):
        energies = []
        for way in (1e-5, -1e-5):
            body.positions = rest.copy()
            body.positions[place] += way
            energies.append(body.energy())
        assert forces[place] == pytest.approx((energies[1] - energies[0]) / 2e-5, rel=1e-5, abs=0.1)


def test_the_reference_keeps_its_energy_through_a_bounce():
    body = Reference(SMALL, 80)
    before, fallen = body.energy(), SMALL.masses.sum() * GRAVITY * SMALL.height
    for _ in range(round(SMALL.seconds * RATE)):
        body.advance()
        assert body.energy() == pytest.approx(before, abs=0.005 * fallen)


def test_the_reference_is_the_same_by_steps_half_as_long():
    outcomes = []
    for steps in (40, 80):
        body = Reference(SMALL, steps)
        engine = Simulation(body.advance, lambda body=body: body.positions, body.h)
        outcomes.append(measure(SMALL, record(SMALL, lambda _, engine=engine: engine, 1)))
    assert outcomes[0].squash == pytest.approx(outcomes[1].squash, rel=3e-3)
    assert outcomes[0].bounce == pytest.approx(outcomes[1].bounce, rel=1e-2)


@pytest.mark.parametrize(("squash", "speed_back"), [(0.2, 0.9), (0.35, 0.5), (0.1, 1.0)])
def test_squash_is_what_the_top_sinks_by_and_bounce_the_square_of_the_speed_that_is_left(squash, speed_back):
    outcome = measure(SMALL, bounced(SMALL, squash, speed_back))
    assert outcome.squash == pytest.approx(squash, rel=0.02)
    assert outcome.bounce == pytest.approx(speed_back**2, rel=0.02)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e3])
def test_steps_are_halved_until_the_body_holds_together(bad):
    tried = []

    def make(steps, enough=12):
        tried.append(steps)
        rows = SMALL.start + (0.0 if steps >= enough else bad)
        return Simulation(lambda: None, lambda: rows, 1 / steps)

    assert record(SMALL, make, 3).step == 1 / 12
    assert tried == [3, 6, 12]
    with pytest.raises(StateError, match="192 steps"):
        record(SMALL, lambda steps: make(steps, np.inf), 3)


def test_between_two_moments_vertices_are_on_the_line_between():
    trajectory = Trajectory(np.arange(18.0).reshape(3, 2, 3), np.ones(1), 1.0)
    np.testing.assert_allclose(trajectory.at(1.25 / RATE), trajectory.positions[1] + 0.25 * 6)
    np.testing.assert_allclose(trajectory.at(9.0), trajectory.positions[2])


@pytest.fixture
def entries():
    exact = bounced(SMALL, 0.2, 1.0)
    off = bounced(SMALL, 0.25, 0.9)
    reference = measure(SMALL, exact)
    return [
        Entry("taichi-soft", off, measure(SMALL, off), reference),
        Entry("reference", exact, reference, reference),
    ]


def test_captions_say_cost_and_error(entries):
    assert captions(entries[0]) == [
        "taichi-soft",
        "1.0 ms for a frame of 1/60 s",
        "squashed by 25.0%, 25% too much",
        "bounces back to 81%, 19% too little",
    ]
    assert len(captions(entries[1])) == 3


def test_the_wall_has_a_panel_for_each_engine_in_which_its_own_body_is_drawn(tmp_path, entries):
    """Pictures side by side: where trajectories differ, so do their panels, but for words and colours."""
    seen = []
    with VideoWriter(tmp_path / "w.png", fps=10, size=(480, 160)) as writer:
        film_wall(SMALL, [*entries, entries[1]], writer, seconds=0.5, on_frame=lambda *now: seen.append(now))
    assert seen == [(i + 1, 5) for i in range(5)]
    pictures = [cv2.imread(str(path)) for path in sorted(tmp_path.iterdir())]
    assert [picture.shape for picture in pictures] == [(160, 480, 3)] * 5
    width = (480 - 8) // 3
    panels = [pictures[2][:, at : at + width] for at in (0, width + 4, 2 * (width + 4))]
    np.testing.assert_array_equal(panels[1], panels[2])
    assert np.abs(panels[0].astype(int) - panels[1]).max() > 50


def test_here_and_the_reference_are_compared_where_no_engine_is_installed(monkeypatch):
    monkeypatch.setattr(comparison, "PEERS", ())
    told = []
    ours, exact = compare(SMALL, lambda *now: told.append(now))
    assert [ours.name, exact.name] == ["taichi-soft", "reference"]
    assert exact.squash_error == exact.bounce_error == 0.0
    assert abs(ours.squash_error) < 0.1
    assert abs(ours.bounce_error) < 0.2
    assert told[-1] == ("reference", 48, 48)


def test_the_command_names_what_is_missing_and_writes_the_film(monkeypatch, capsys, tmp_path, entries):
    monkeypatch.setattr(peers, "missing_peers", lambda: ["mujoco", "newton"])
    monkeypatch.setattr(peers, "compare", lambda drop, show: entries)
    monkeypatch.setattr(peers, "Drop", lambda: SMALL)
    film_peers(tmp_path / "w.mp4", 0.5, 10.0, "320x160", arch="cpu")
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "not installed here: mujoco, newton: pip install -e '.[peers]'"
    assert lines[1].endswith("w.mp4: 5 frames, 0.5 s")
    assert lines[2].startswith("taichi-soft; 1.0 ms")
    assert Path(tmp_path / "w.mp4").stat().st_size > 0


@pytest.mark.parametrize(
    ("name", "seconds", "error"), [("w.mkv", 1.0, VideoError), ("w.mp4", -1.0, OptionError)]
)
def test_a_film_that_cannot_be_written_is_refused_before_anything_is_simulated(
    monkeypatch, tmp_path, name, seconds, error
):
    monkeypatch.setattr(peers, "compare", lambda *_: pytest.fail("simulated"))
    with pytest.raises(error):
        film_peers(tmp_path / name, seconds, 10.0, "320x160", arch="cpu")
