"""Flight recordings: written when a body freezes or on request, and repeated from the file alone."""

import base64
import json
import tracemalloc
import zlib

import numpy as np
import pytest
from random_play import DT, SUBSTEPS, act, make_world, play

from taichi_soft import (
    FrozenBodyWarning,
    Material,
    OptionError,
    SnapshotError,
    SoftBodyAsset,
    StateError,
    box,
)
from taichi_soft.cli import main
from taichi_soft.core.container import seal
from taichi_soft.core.serialisation import to_json
from taichi_soft.persistence.recorder import MARK, VERSION, read_recording
from taichi_soft.render.replay import replay
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak


@pytest.fixture(scope="module")
def game(tmp_path_factory):
    """A world that records, 70 ticks into a random game, and its recording."""
    world, cube = make_world(record=30)
    play(world, cube, 70, seed=21)
    path = world.save_recording(tmp_path_factory.mktemp("recording") / "sub" / "game.recording")
    return world, path


@pytest.fixture(scope="module")
def broken(tmp_path_factory):
    """Let a body fail in step 12, and another later.

    Return the path of the recording, the failure, the hash, and True if the second failure left the recording
    unchanged.
    """
    path = tmp_path_factory.mktemp("frozen") / "it.recording"
    # Without soft contact, because its search would cover the whole volume of such a body.
    world = bare_world(record=5, record_to=path, retries=0)
    for x in (0.0, 2.0):
        world.add_body(box(cells=(1, 1, 1)), Material(1e5, 0.2, 1000.0, 20.0), position=(x, 0, 0.6))
    world.build()
    world.set_force_field(lambda positions, time: np.full_like(positions, 0.3) * np.sin(9 * time))
    for _ in range(12):
        world.step(DT, SUBSTEPS)
    assert not path.exists()
    body, other = world.bodies
    tear_to_pieces(body)
    with pytest.warns(FrozenBodyWarning, match=r"taichi-soft replay .*it.recording"):
        world.step(DT, SUBSTEPS)
    first, name = path.read_bytes(), world.state_hash()
    tear_to_pieces(other)
    with pytest.warns(FrozenBodyWarning):
        world.step(DT, SUBSTEPS)
    return path, body.failure, name, path.read_bytes() == first


def tear_to_pieces(body):
    fast = 9e3 * np.where(np.arange(body.vertex_count) % 2, 1, -1)
    body.set_motion(body.positions(), fast[:, None] * np.ones(3))


@pytest.mark.guard
def test_a_random_game_is_made_again_bit_by_bit(game, tmp_path):
    world, path = game
    report = replay(path)
    assert 30 <= report.steps < 60
    assert report.first_difference is None
    assert report.world.state_hash() == world.state_hash()
    assert report.world.step_count == 70


def test_a_frozen_body_writes_what_led_to_it(broken, tmp_path):
    path, failure, name, _ = broken
    report = replay(path, tmp_path / "end.png")
    assert report.first_difference is None
    assert report.failures == (failure,)
    assert failure.tetrahedron is not None
    assert report.steps >= 5
    assert report.world.state_hash() == name
    assert (tmp_path / "end.png").stat().st_size > 1000


def test_the_command_tells_what_broke_and_draws_it(broken, tmp_path, capsys):
    path, failure, _, _ = broken
    picture = tmp_path / "moment.png"
    with pytest.raises(SystemExit) as ended:
        main("replay", str(path), "--out", str(picture))
    assert ended.value.code in (0, None)
    out = capsys.readouterr().out
    assert "all states are bit-identical" in out
    assert f"tetrahedron {failure.tetrahedron} failed first" in out
    assert picture.exists()


def test_only_the_first_freeze_is_written(broken):
    assert broken[3]


def test_undone_steps_are_not_in_the_recording(game, tmp_path):
    """In every second tick, steps are undone, back to before or after the inputs of the tick."""
    world, _ = game
    cube, first = world.bodies[0].asset, world.step_count
    for tick in range(50):
        is_late = tick % 2 == 0
        if is_late and tick % 4:
            act(world, cube, seed=21)
        data = world.snapshot()
        if is_late:
            play(world, cube, 5, seed=22)
            world.restore(data)
        if not (is_late and tick % 4):
            act(world, cube, seed=21)
        world.step(DT, SUBSTEPS)
    report = replay(world.save_recording(tmp_path / "undone.recording"))
    assert 25 <= report.steps < 60
    assert report.first_difference is None
    assert report.world.step_count == first + 50
    assert report.world.state_hash() == world.state_hash()


def test_after_a_state_that_is_not_kept_the_recording_begins_again(game, tmp_path):
    world, _ = game
    data = world.snapshot()
    for _ in range(60):
        world.step(DT, SUBSTEPS)
    world.restore(data)
    world.bodies[0].apply_impulse((5, 0, 0))
    world.step(DT, SUBSTEPS)
    report = replay(world.save_recording(tmp_path / "again.recording"))
    assert (report.steps, report.first_difference) == (1, None)
    assert report.world.state_hash() == world.state_hash()


def test_refused_calls_are_not_recorded(game, tmp_path):
    world, _ = game
    body = world.bodies[0]
    with pytest.raises(OptionError):
        body.apply_impulse((0, 0, np.nan))
    body.apply_impulse((0, 0, 1))
    world.step(DT, SUBSTEPS)
    made_of, _ = read_recording(world.save_recording(tmp_path / "calls.recording"))
    calls = [entry for entry in made_of["entries"] if entry[:3] == ["call", body._serial, "apply_impulse"]]
    assert calls[-1][3] == [[0, 0, 1]]


def test_arguments_are_kept_as_they_were(game, tmp_path):
    world, _ = game
    push = np.array([0.0, 0.0, 3.0])
    world.bodies[0].apply_impulse(push)
    push[:] = 7.0
    world.step(DT, SUBSTEPS)
    report = replay(world.save_recording(tmp_path / "kept.recording"))
    assert report.first_difference is None


def test_damaged_and_foreign_recordings_are_refused(game, tmp_path):
    _, path = game
    data = path.read_bytes()
    bad = tmp_path / "bad.recording"
    for at in (0, 9, 20, 60, len(data) // 2, len(data) - 1):
        changed = bytearray(data)
        changed[at] ^= 1
        bad.write_bytes(changed)
        with pytest.raises(SnapshotError):
            replay(bad)
    for content in (b"", data[:-1], data[:50], seal(MARK, VERSION, [b"?", b""]), seal(MARK, VERSION, [])):
        bad.write_bytes(content)
        with pytest.raises(SnapshotError):
            replay(bad)
    with pytest.raises(SnapshotError, match="cannot read"):
        replay(tmp_path / "nowhere.recording")


def test_what_a_page_saved_replaces_the_steps_of_its_recording(game, tmp_path):
    """A wrong hash is found at its step."""
    _, path = game
    entries = json.loads(to_json(read_recording(path)[0]["entries"]))
    while entries[0][0] == "call":  # calls before the first step stay
        del entries[0]
    saved = tmp_path / "played.json"

    def replayed(entries, **options):
        start = base64.b64encode(path.read_bytes()).decode()
        saved.write_text(json.dumps({"start": start, "entries": entries}))
        return replay(saved, **options)

    ends = [i + 1 for i, entry in enumerate(entries) if entry[0] == "step"]
    whole = replayed(entries, steps=3)
    assert (whole.steps, whole.first_difference) == (3, None)
    entries[ends[2] - 1][3] = whole.hash  # in the format of a page
    entries[ends[1] - 1][3] = whole.hash  # which is the hash of the step after
    short = replayed(entries[: ends[2]])
    assert (short.steps, short.hash) == (3, whole.hash)
    assert short.first_difference == whole.world.step_count - 1
    for content in ('{"start": "", "entries": []}', '{"entries": []}', "{", '{"start": "?"}', '{"start": 3}'):
        saved.write_text(content)
        with pytest.raises(SnapshotError):
            replay(saved)
    saved.write_text(json.dumps({"start": "", "entries": entries})[:-100])
    with pytest.raises(SnapshotError, match=r"is damaged \(.*: save it again there"):
        replay(saved)
    with pytest.raises(OptionError, match="steps"):
        replay(path, steps=-1)


def test_a_recording_inflates_to_so_much_and_no_more(game, tmp_path, monkeypatch):
    world, path = game
    monkeypatch.setattr("taichi_soft.persistence.recorder.MAX_CONTENT", 1 << 20)
    bomb = tmp_path / "bomb.recording"
    bomb.write_bytes(seal(MARK, VERSION, [zlib.compress(b" " * (1 << 27), 9), b""]))
    tracemalloc.start()
    try:
        with pytest.raises(SnapshotError, match="more than 1 MB"):
            read_recording(bomb)
        assert tracemalloc.get_traced_memory()[1] < 1 << 23
    finally:
        tracemalloc.stop()
    monkeypatch.setattr("taichi_soft.persistence.recorder.MAX_CONTENT", 1000)
    before = path.read_bytes()
    with pytest.raises(SnapshotError, match="smaller record"):
        world.save_recording(path)
    assert path.read_bytes() == before


def test_a_recording_asks_for_recorded_calls_only(game, tmp_path):
    """Even a forged file makes no calls except those that a recorder records."""
    _, path = game
    made_of, snapshot = read_recording(path)
    for serial, name in ((0, "save_recording"), (0, "_change"), (1, "__init__"), (10**6, "pin")):
        made_of["entries"] = [["call", serial, name, [str(tmp_path / "evil")], {"options": {}}]]
        bad = tmp_path / "bad.recording"
        bad.write_bytes(seal(MARK, VERSION, [zlib.compress(to_json(made_of)), snapshot]))
        with pytest.raises(SnapshotError, match="not a call"):
            replay(bad)
    assert not (tmp_path / "evil").exists()


def test_bad_options_are_refused(tmp_path):
    for bad in (-1, 2.5, True):
        with pytest.raises(OptionError):
            bare_world(record=bad)
    with pytest.raises(OptionError):
        bare_world(record=3, record_to=5)
    with pytest.raises(StateError, match="build"):
        bare_world(record=3).save_recording(tmp_path / "x")
    world = bare_world()
    asset = SoftBodyAsset(box(cells=(1, 1, 1)), Material(1e5, 0.2, 1000.0, 20.0))
    world.reserve(asset, 1)
    world.build()
    with pytest.raises(StateError, match=r"record=240"):
        world.save_recording(tmp_path / "x")
