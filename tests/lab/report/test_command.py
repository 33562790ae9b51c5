"""`python -m lab report`, with experiments that compute nothing."""

import shlex
import warnings
from importlib import import_module

import pytest
from fakes import NOTHING, SQUARES

from lab import cli
from lab.report import run
from taichi_soft.core.runtime import Device

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]


@pytest.fixture
def report(monkeypatch, capfd, measured, here, tmp_path):
    """Return a function that runs the command and returns exit code, output and errors."""
    monkeypatch.setattr(run, "EXPERIMENTS", {"squares": SQUARES, "nothing": NOTHING})
    monkeypatch.setattr(import_module("lab.cli.report"), "init", lambda arch: Device("cpu", 1, "a test"))
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")

    def run_command(*arguments):
        with pytest.raises(SystemExit) as ended:
            cli.main("report", *map(str, arguments))
        return ended.value.code or 0, *capfd.readouterr()

    return run_command


def test_the_list_names_every_experiment_and_computes_nothing(report, measured, tmp_path):
    code, output, errors = report("--list")
    assert (code, errors) == (0, "")
    assert [line.split()[0] for line in output.splitlines()] == ["squares", "nothing"]
    assert not (tmp_path / "out").exists()
    assert measured() == []


def test_help_says_what_every_option_does(report):
    code, output, errors = report("--help")
    assert (code, errors) == (0, "")
    for option in ("--out", "--quick", "--workers", "--arch", "--list", "[names]..."):
        assert option in output


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["nope"], "'nope': choose one of 'squares', 'nothing'"),
        (["squars"], "Did you mean 'squares'?"),
        (["--list", "nope"], "'nope'"),
        (["--out", "/proc/nowhere"], "'/proc/nowhere'"),
        (["--out", "file"], "'file'"),
        (["--out", "file/folder"], "'file/folder'"),
    ],
)
def test_what_cannot_be_done_is_one_line_before_anything_is_measured(
    report, measured, tmp_path, arguments, named
):
    (tmp_path / "file").touch()
    code, output, errors = report(*arguments)
    assert (code, output) == (1, "")
    assert named in errors
    assert len(errors.splitlines()) == 1
    assert measured() == []


def test_named_experiments_are_printed_and_their_numbers_kept(report, measured, tmp_path):
    code, output, errors = report("squares", "--quick")
    assert (code, errors) == (0, "3 points of 1 experiments\n")
    for word in ("Squares.", "x^2 [m^2]", "agrees"):
        assert word in output
    assert measured() == ["0", "1", "2"]
    assert [path.name for path in (tmp_path / "out" / "report").iterdir()] == ["data"]
    report("squares")
    assert measured() == ["3", "4"]


def test_a_page_is_written_and_names_the_command_that_makes_it(report, tmp_path):
    folder = tmp_path / "a folder"
    code, output, _ = report("squares", "--out", folder, "--quick")
    assert code == 0
    assert f"wrote {folder / 'report.html'}" in output
    command = shlex.join(["python", "-m", "lab", "report", "squares", "--out", str(folder), "--quick"])
    assert command in (folder / "report.html").read_text().replace("&#39;", "'")
    assert "Squares." in (folder / "report.md").read_text()


def test_where_points_failed_the_page_is_written_all_the_same_and_the_exit_code_is_1(report, tmp_path):
    code, output, errors = report("--quick")
    assert code == 1
    assert "3 points could not be computed" in output
    assert errors.count("nothing to see") == 3
    assert "nothing to see" in (tmp_path / "out" / "report" / "report.html").read_text()
