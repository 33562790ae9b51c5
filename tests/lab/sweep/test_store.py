"""Results in files: resumed, truncated, of another format, of another version of the code."""

import json
import math

import pytest

from lab.sweep import Outcome, Store, SweepError, origin
from lab.sweep.provenance import sources

pytestmark = pytest.mark.soak

MINE = {"sources": "0123456789abcdef", "arch": "cpu"}
OTHER = {"sources": "fedcba9876543210", "arch": "cpu"}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "data" / "bars.jsonl"


def fill(path, count=3, origin=MINE):
    store = Store(path, origin)
    for x in range(count):
        store.keep({"x": x, "law": "face"}, Outcome({"force": x / 3}, seconds=0.5))
    store.close()


def test_what_was_kept_is_there_again_to_the_bit_whatever_the_order_of_names(path):
    fill(path)
    store = Store(path, MINE)
    for x in range(3):
        assert store.get({"law": "face", "x": x}) == Outcome({"force": x / 3}, "", 0.5)
    assert store.get({"x": 3, "law": "face"}) is None
    assert store.set_aside is None


def test_it_is_in_the_file_before_the_file_is_closed(path):
    store = Store(path, MINE)
    store.keep({"x": 1}, Outcome(None, "lost"))
    assert json.loads(path.read_text().splitlines()[1]) == {
        **{"point": {"x": 1}, "numbers": None, "error": "lost", "seconds": 0.0}
    }


def test_the_later_of_two_outcomes_counts(path):
    store = Store(path, MINE)
    store.keep({"x": 1}, Outcome(None, "lost"))
    store.keep({"x": 1}, Outcome({"force": math.inf}))
    store.close()
    assert Store(path, MINE).get({"x": 1}) == Outcome({"force": math.inf})


def test_a_file_cut_off_anywhere_loses_no_more_than_its_last_line(path):
    fill(path)
    whole = path.read_bytes()
    ends = [n + 1 for n, byte in enumerate(whole) if byte == ord("\n")]
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        store = Store(path, MINE)
        kept = [x for x in range(3) if store.get({"x": x, "law": "face"})]
        assert len(kept) == max(0, sum(end <= length for end in ends) - 1)
        for x in {0, 1, 2} - set(kept):
            store.keep({"x": x, "law": "face"}, Outcome({"force": x / 3}, seconds=0.5))
        store.close()
        assert path.read_bytes() == whole


@pytest.mark.parametrize(
    ("damage", "named"),
    [
        (lambda lines: [b"\x89PNG\r\n\x1a\n"], "line 1"),
        (lambda lines: [b"x,y"], "line 1"),
        (lambda lines: [b"[1]", *lines[1:]], "line 1"),
        (lambda lines: lines[1:], "line 1"),
        (lambda lines: [lines[0].replace(b"sweep 1", b"sweep 2"), *lines[1:]], "'taichi-soft sweep 2'"),
        (lambda lines: [lines[0], b"{", *lines[1:]], "line 2"),
        (lambda lines: [*lines, b"\0\0\0"], "line 5"),
        (lambda lines: [*lines, b"[" * 100_000], "line 5"),
        (lambda lines: [*lines, b'{"point": 1, "numbers": {}, "error": "", "seconds": 1}'], "line 5"),
        (lambda lines: [*lines, b'{"point": {}, "numbers": [], "error": "", "seconds": 1}'], "line 5"),
        (lambda lines: [*lines, b'{"point": {}, "numbers": {}, "error": "", "time": 1}'], "line 5"),
    ],
)
def test_a_broken_or_foreign_file_is_refused_in_one_line_and_left_as_it_is(path, damage, named):
    fill(path)
    path.write_bytes(b"\n".join(damage(path.read_bytes().splitlines())) + b"\n")
    before = path.read_bytes()
    with pytest.raises(SweepError, match="move") as caught:
        Store(path, MINE)
    assert named in str(caught.value)
    assert repr(str(path)) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert path.read_bytes() == before
    assert [each.name for each in path.parent.iterdir()] == [path.name]


def test_a_foreign_file_without_any_end_of_line_is_not_overwritten(path):
    path.parent.mkdir()
    path.write_text("precious")
    with pytest.raises(SweepError):
        Store(path, MINE)
    assert path.read_text() == "precious"


def test_results_of_other_code_are_set_aside_again_and_again(path):
    for _ in range(3):
        fill(path, origin=OTHER)
        before = path.read_bytes()
        store = Store(path, MINE)
        assert store.get({"x": 0, "law": "face"}) is None
        assert store.set_aside.read_bytes() == before
        store.close()
        path.unlink()
    names = {each.name for each in path.parent.iterdir()}
    assert names == {"bars.fedcba98.jsonl", "bars.fedcba98-1.jsonl", "bars.fedcba98-2.jsonl"}


def test_what_cannot_be_written_is_refused_in_one_line(tmp_path):
    (tmp_path / "data").write_text("a file")
    with pytest.raises(SweepError, match="choose another folder"):
        Store(tmp_path / "data" / "bars.jsonl", MINE)


def test_results_depend_on_all_but_what_shows_them():
    folders = {"/".join(name.split("/")[:2]) for name in sources()}
    assert folders >= {*(f"taichi_soft/{name}" for name in ("bodies", "contact", "solver", "world"))}
    assert folders >= {*(f"lab/{name}" for name in ("drop_test", "experiments", "sweep"))}
    assert folders.isdisjoint({"taichi_soft/cli", "lab/cli", "lab/report"})


def test_the_origin_is_of_the_sources_and_of_the_device(tmp_path):
    assert origin("cpu") == origin("cpu")
    assert len(origin("cpu")["sources"]) == 64
    assert origin("cpu") != origin("cuda")
