"""The command line as a user runs it: in a separate process."""

import json
import subprocess
import sys
from importlib.metadata import version

import cv2
import pytest
from typer.main import get_command
from typer.testing import CliRunner

from taichi_soft import LAWS
from taichi_soft.cli.app import app
from taichi_soft.profiling import LawCost, Spread, find_compiler
from taichi_soft.profiling.law_costs import kinds_of
from taichi_soft.profiling.profile_tables import law_table

pytestmark = pytest.mark.soak

SPREAD = Spread(1.0, 1.0, 1.0, 1.0)


def run(*arguments: str, cwd=None) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, "-m", "taichi_soft", *arguments],
        capture_output=True,
        text=True,
        cwd=cwd,
        timeout=300,
    )


@pytest.mark.parametrize("command", [(), ("demo",), ("info",), ("profile",), ("warm",), ("bake",)])
def test_every_command_explains_itself(command):
    done = run(*command, "--help")
    assert done.returncode == 0
    assert "Usage" in done.stdout
    assert done.stderr == ""


COMMANDS = [(name, each) for name, each in get_command(app).commands.items() if not each.hidden]


@pytest.mark.parametrize(("name", "command"), COMMANDS, ids=[name for name, _ in COMMANDS])
def test_help_shows_every_description_whole_and_no_type_of_a_switch(name, command):
    """Units in brackets are not markup, and switches show no value."""
    shown = " ".join(CliRunner().invoke(app, [name, "--help"]).output.split())
    for parameter in command.params:
        if getattr(parameter, "hidden", False):
            continue
        assert parameter.help
        assert " ".join(parameter.help.split()) in shown
    assert "bool" not in shown
    summary = command.help.split("\n\n")[0]
    overview = " ".join(CliRunner().invoke(app, ["--help"]).output.split())
    assert f"{name} {' '.join(summary.split())}" in overview


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        (("dmeo",), "demo"),
        (("demo", "jely"), "jelly"),
        (("live", "jely"), "jelly"),
        (("demo", "bounce", "--secnds", "2"), "--seconds"),
        (("info", "--law", "viral"), "virial"),
        (("doctor", "duck.glb", "--material", "gelatin"), "gelatine"),
    ],
)
def test_a_misspelt_name_is_answered_with_the_one_that_was_meant(arguments, meant, tmp_path):
    done = run(*arguments, cwd=tmp_path)
    assert done.returncode in (1, 2)
    last = done.stderr.strip().splitlines()[-1]
    assert "Did you mean" in last or "Possible options" in last
    assert meant in last.rpartition("(" if "(" in last else "Did you mean")[2]


def test_an_unknown_device_is_refused_with_those_there_are():
    done = run("info", "--arch", "abacus")
    assert done.returncode == 2
    assert all(name in done.stderr for name in ("'abacus'", "auto", "cpu", "cuda", "vulkan", "metal"))
    assert "Traceback" not in done.stderr


def test_demo_without_a_name_lists_the_demos_with_a_summary_each():
    done = run("demo")
    assert done.returncode == 0
    lines = done.stdout.splitlines()
    assert [line.split()[0] for line in lines] == [
        *("attach", "bars", "bounce", "bowl", "bridge", "cloth", "compare", "cut", "density", "dents"),
        *(
            "drape",
            "elephants",
            "feel",
            "flag",
            "grab",
            "jelly",
            "lod",
            "many",
            "playground",
            "rollback",
            "tower",
            "walk",
            "wheels",
        ),
    ]


@pytest.mark.guard
def test_demo_writes_a_film_and_says_how_fast_it_ran(tmp_path):
    film = tmp_path / "films" / "b.webm"
    how = ("--size", "128x96", "--threads", "1", "--slow", "2", "--blur", "2", "--framed")
    done = run("demo", "bounce", "--seconds", "0.2", "--out", str(film), *how)
    assert done.returncode == 0, done.stderr
    capture = cv2.VideoCapture(str(film))
    assert int(capture.get(cv2.CAP_PROP_FRAME_COUNT)) == 20
    assert "x real time" in done.stdout.replace("\n", " ")
    assert "a frame of 128x96 took" in done.stdout
    assert done.stderr == ""


@pytest.mark.guard
@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("demo", "nope"), "'nope'"),
        (("demo", "bounce", "--size", "12"), "'12'"),
        (("demo", "bounce", "--out", "x.mkv"), ".mp4"),
        (("demo", "bounce", "--out", "/proc/nowhere/x.mp4"), "/proc/nowhere"),
        (("demo", "bounce", "--seconds", "-1"), "-1"),
        (("demo", "bounce", "--fps", "nan"), "nan"),
        (("demo", "bounce", "--slow", "0.5"), "slow"),
        (("demo", "bounce", "--blur", "0"), "blur"),
        (("demo", "bounce", "--orbit", "0"), "period"),
        (("info", "--threads", "0"), "0"),
        (("info", "--law", "none"), "'none'"),
        (("profile", "--cores", "first"), "'first'"),
        (("profile", "--cores", "0,4095"), "4095"),
    ],
)
def test_a_wrong_argument_gives_one_line_that_names_it_and_exit_code_1(arguments, named, tmp_path):
    done = run(*arguments, cwd=tmp_path)
    assert done.returncode == 1
    assert len(done.stderr.strip().splitlines()) == 1
    assert named in done.stderr
    assert "Traceback" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] in ([], ["out"])


@pytest.mark.parametrize(
    ("arguments", "now"),
    [
        (("report", "fig-6.4", "--quick"), "python -m lab report"),
        (("report", "--help"), "python -m lab report"),
        (("drop-test", "--sweep", "--only", "own"), "python -m lab drop-test"),
        (("demo", "compare", "--peers"), "python -m lab peers"),
    ],
)
def test_a_command_of_before_says_in_one_line_where_it_is(arguments, now, tmp_path):
    done = run(*arguments, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (1, "")
    (line,) = done.stderr.splitlines()
    assert now in line
    assert "checkout" in line
    assert list(tmp_path.iterdir()) == []


def test_help_shows_no_command_or_option_of_before():
    shown = CliRunner().invoke(app, ["--help"]).output + CliRunner().invoke(app, ["demo", "--help"]).output
    assert [word for word in ("report", "drop-test", "--peers") if word in shown] == []


def test_an_unknown_option_gives_exit_code_2():
    done = run("info", "--nonsense")
    assert done.returncode == 2
    assert "--nonsense" in done.stderr


def test_the_version_is_that_of_the_package():
    done = run("--version")
    assert done.returncode == 0
    assert done.stdout == f"taichi-soft {version('taichi-soft')}\n"


def test_info_says_which_device_and_versions():
    facts = json.loads(run("info", "--json", "--arch", "cpu", "--threads", "1").stdout)
    assert facts["device"] == "cpu"
    assert facts["threads"] == 1
    assert facts["taichi"] == "1.7.4"
    assert facts["law"]["virial"] == "Hooke's stress to forces by the virial theorem (thesis 6.3)"
    assert facts["material"]["thesis_sphere"].startswith("E = 1 MPa, nu = 0.1")


def test_laws_are_measured_with_every_strain_and_kind_of_material():
    rows = [(law.name, strain, is_anisotropic) for law, strain, is_anisotropic in kinds_of(LAWS.values())]
    assert rows == [
        ("virial", "linear", False),
        ("virial", "exact", False),
        ("virial", "linear", True),
        ("face", "linear", False),
        ("face", "exact", False),
        ("face", "linear", True),
        ("st_venant_kirchhoff", "linear", False),
        ("st_venant_kirchhoff", "linear", True),
        ("neo_hookean", None, False),
        *((name, None, False) for name in list(LAWS)[4:]),
    ]
    table = law_table([LawCost(*row, "edge", SPREAD, SPREAD) for row in rows])
    assert table.row_count == len(rows)
    cells = {column.header: list(column.cells) for column in table.columns}
    assert all("young" in text or "stiffness" in text for text in cells["parameters"])


def test_info_lists_laws_with_their_costs():
    names = ("st_venant_kirchhoff", "neo_hookean", "springs")
    options = [text for name in names for text in ("--law", name)]
    costs = json.loads(run("info", *options, "--json").stdout)
    assert [(cost["law"], "frame" in cost["parameters"]) for cost in costs] == [
        ("st_venant_kirchhoff", False),
        ("st_venant_kirchhoff", True),
        ("neo_hookean", False),
        ("springs", False),
    ]
    assert all(cost["ratio"]["least"] > 0 for cost in costs)
    assert [cost["element"] for cost in costs] == ["tetrahedron", "tetrahedron", "tetrahedron", "edge"]
    assert all(cost["source"] == LAWS[cost["law"]].source for cost in costs)


def test_profile_prints_phases_and_budgets_as_json():
    done = run("profile", "--json", "--bodies", "2", "--repeats", "5", "--arch", "cpu")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert [row["rate"] for row in found["budget"]] == [60, 120]
    measured = found["budget"][0]["measured"]
    assert set(measured["phases"]) == {"elastic", "damping", "motion"}
    for spread in (*measured["phases"].values(), measured["frame"], measured["python"]):
        assert 0 < spread["least"] <= spread["median"] <= spread["p99"] <= spread["most"]
    assert found["budget"][0]["tets"] == found["budget"][0]["bodies"] * measured["tets"] // 2


@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler here")
def test_profile_compares_with_cpp_and_threads():
    options = ("--baseline", "--scaling", "--repeats", "3", "--bodies", "1")
    done = run("profile", *options, "--threads", "2", "--arch", "cpu")
    assert done.returncode == 0, done.stderr
    for title in ("Against plain C++", "64 spheres on several threads"):
        assert title in done.stdout


def test_profile_prints_tables_for_people():
    done = run("profile", "--bodies", "1", "--repeats", "3", "--arch", "cpu")
    assert done.returncode == 0, done.stderr
    assert "What fits a frame" in done.stdout
    assert "120 Hz" in done.stdout
