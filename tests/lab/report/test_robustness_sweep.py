"""The sweep of `drop-test`: cells are stored, resumed and counted by law."""

import io
import sys

import pytest
from rich.console import Console

from lab.drop_test.robustness import Verdict, choose_cells
from lab.experiments import Result
from lab.report import robustness
from lab.sweep import Store
from taichi_soft.core.errors import OptionError

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

VERDICTS = ("ok", "frozen", "inverted", "too slow")


@pytest.fixture
def console():
    return Console(file=io.StringIO(), width=200)


@pytest.fixture
def computed(monkeypatch, here):
    """Names of the cells that were computed; their verdicts follow from their meshes' names."""
    names = []

    def invent(cell):
        names.append(cell["name"])
        verdict = VERDICTS[len(cell["mesh"]) % len(VERDICTS)]
        reason = "" if verdict == "ok" else f"so it is *invented* | {cell['damping']}"
        return {"tets": 7, "min_dihedral": 12.34, "substeps": 9, "verdict": verdict, "reason": reason}

    monkeypatch.setattr(robustness, "run_cell", invent)
    return names


def sweep(folder, cells, console):
    return robustness.run_sweep(cells, folder, console, workers=1, arch="cpu")


def page(rows, path):
    robustness.write_page(rows, path, "python -m lab drop-test --sweep", "cpu")
    return path.read_text()


def test_a_sweep_that_was_interrupted_ends_with_the_table_of_one_that_was_not(
    tmp_path, console, computed, monkeypatch
):
    cells = choose_cells(["own", "wrecked"], law="virial", count=4)
    whole = page(sweep(tmp_path / "whole", cells, console), tmp_path / "whole.md")
    assert len(computed) == len(cells)
    computed.clear()
    keep, kept = Store.keep, []

    def keep_seven(self, point, outcome):
        if len(kept) == 7:
            raise KeyboardInterrupt
        kept.append(point)
        keep(self, point, outcome)

    with monkeypatch.context() as patch:
        patch.setattr(Store, "keep", keep_seven)
        with pytest.raises(KeyboardInterrupt):
            sweep(tmp_path / "parts", cells, console)
    computed.clear()
    parts = page(sweep(tmp_path / "parts", cells, console), tmp_path / "parts.md")
    assert len(computed) == len(cells) - 7
    assert parts == whole


def test_without_scipy_nothing_is_computed(tmp_path, console, computed, monkeypatch):
    monkeypatch.setitem(sys.modules, "scipy", None)
    with pytest.raises(OptionError, match=r"taichi-soft\[voronoi\]"):
        sweep(tmp_path, choose_cells(["foreign"], count=2), console)
    assert computed == []
    assert list(tmp_path.iterdir()) == []


def row(group, law, flips, verdict, name="a cell", damping="default"):
    cell = {
        "wreck": None,
        "group": group,
        "name": name,
        "mesh": name,
        "scale": 1.0,
        "law": law,
        "flips": flips,
        "damping": damping,
    }
    facts = {"tets": 7, "min_dihedral": 12.34, "substeps": 9, "mach": 0.1, "sag": 0.01}
    return Result(cell, {**facts, "verdict": verdict, "reason": "" if verdict == "ok" else "why | it is"})


ROWS = [
    row("own", None, None, "ok"),
    row("own", None, None, "frozen", "bad one"),
    row("own", None, None, "ok"),
    row("own", "virial", "recover", "inverted", "hidden one"),
    Result(row("own", "virial", "recover", "ok").point, None, "stopped: it took longer than 600 s"),
    row("wrecked", None, None, "misshapen", "third one"),
]


def test_cells_are_counted_by_group_law_and_verdict(tmp_path):
    counted = robustness.counts_by_law(ROWS)
    assert counted["own", "default", "", "default"] == {Verdict.OK: 2, Verdict.FROZEN: 1}
    assert counted["own", "virial", "recover", "default"] == {Verdict.INVERTED: 1, Verdict.NO_RESULT: 1}
    text = page(ROWS, tmp_path / "docs" / "sweep.md")
    assert "| own | default |  | default | 2 | 1 |" in text
    assert "- frozen: own, bad one (default default): why \\| it is" in text
    assert "hidden one (" not in text  # what games get by default is listed; the rest is counted
    assert "| own | bad one | 7 | 12.3 | 9 |" in text


def test_a_terminal_shows_the_table_and_the_first_that_do_not_hold(console):
    robustness.print_sweep(console, [*ROWS, row("own", None, None, "frozen", "another one")], worst=1)
    text = console.file.getvalue()
    assert "frozen: own, bad one (default default): why | it is" in text
    assert "another one" not in text
    assert "misshapen: wrecked, third one" in text


def test_a_body_that_no_material_could_save_is_told_apart():
    crushed = row("cells", None, None, "inverted")
    crushed.numbers.update(mach=6.26, sag=9.81)
    line = robustness.line_of(crushed)
    assert line.endswith("[hits the floor at Mach 6.3, its own weight is worth a strain of 9.8]")
    assert "Mach" not in robustness.line_of(row("cells", None, None, "inverted"))


def test_only_what_a_game_gets_by_default_counts_as_broken():
    assert [robustness.is_broken(each) for each in ROWS] == [False, True, False, False, False, True]
    assert not robustness.is_broken(row("own", None, None, "too slow"))
    assert not robustness.is_broken(row("own", None, None, "too soft"))
    assert robustness.is_broken(Result(ROWS[0].point, None, "lost"))
