"""The C# wrapper: it plays games as C does, refuses what the library refuses, allocates nothing in a frame.

Mono compiles and runs it here. Unity's components run on stubs of Unity's types.
"""

import os
import re
import shutil
import subprocess

import pytest
from games import lines_of
from native_build import ROOT
from scenes import GAMES, aimed_game, breaking_game, far_game, shifted_game

pytestmark = pytest.mark.soak

SOURCE = ROOT / "engine_adapter" / "native" / "csharp"
HEADER = SOURCE.parent / "include" / "taichi_soft.h"
COMPONENTS = ("TaichiSoft.cs", "SoftWorldBehaviour.cs", "SoftBodyBehaviour.cs")


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """A function that compiles files to a program, once, with warnings as errors, and returns its path."""
    if shutil.which("mcs") is None or shutil.which("mono") is None:
        pytest.skip("needs mcs and mono: apt-get install mono-mcs mono-runtime")
    folder = tmp_path_factory.mktemp("csharp")

    def program(name, *files):
        path = folder / f"{name}.exe"
        if not path.exists():
            options = ["-langversion:7", "-warn:4", "-warnaserror+", f"-out:{path}"]
            done = subprocess.run(
                ["mcs", *options, *(str(SOURCE / file) for file in files)], capture_output=True, text=True
            )
            assert done.returncode == 0, done.stdout + done.stderr
        return path

    return program


@pytest.fixture
def run(native, compiled):
    """A function that runs a program by its name on the library; returns the lines that it prints."""

    def lines(program, folder, *arguments, game=()):
        environment = {**os.environ, "LD_LIBRARY_PATH": str(native)}
        return lines_of(["mono", "--debug", program, folder, *arguments], game, env=environment)

    return lines


@pytest.fixture
def checks(compiled):
    return compiled("Checks", "TaichiSoft.cs", "Checks.cs")


@pytest.mark.parametrize(
    "name",
    [pytest.param("heap", marks=pytest.mark.guard), "free", "held", "joined", "levels", "rigid", "surfaces"],
)
def test_a_game_in_csharp_has_the_same_bits(name, export, play, compiled, run):
    calls = list(GAMES[name][1]())
    folder = export(name)
    found = run(compiled("Play", "TaichiSoft.cs", "Play.cs"), folder, game=calls)
    assert len(set(found)) > 400
    assert found == lines_of([play, folder], calls)


@pytest.mark.parametrize(
    ("name", "game"),
    [("aimed", aimed_game), ("breaking", breaking_game), ("shifted", shifted_game), ("shifted", far_game)],
)
def test_later_games_in_csharp_have_the_same_bits(name, game, export, play, compiled, run):
    calls, folder = list(game()), export(name)
    found = run(compiled("Play", "TaichiSoft.cs", "Play.cs"), folder, game=calls)
    assert found == lines_of([play, folder], calls)


def test_what_calls_cost_is_told_of_a_step_a_mesh_and_a_bare_call(export, compiled, run):
    told = run(compiled("Cost", "TaichiSoft.cs", "Cost.cs"), export("heap"))
    assert [text.split(" ")[0] for text in told] == ["a", "reading", "a"]
    assert told[0].startswith("a step: ")
    assert told[2].startswith("a trivial call: ")


REFUSED = {
    "no folder": "File: cannot read .*export",
    "null folder": "Argument: folder is null",
    "small buffer": "Size: positions has room for 5 numbers: give room for 441",
    "null buffer": "Size: positions has room for 0 numbers",
    "small normals": "Size: normals has room for 5 numbers: give room for 441",
    "small buffer of a mesh": "Size: positions has room for 5 numbers: give room for 276",
    "nan": "Argument: position has -?nan in it",
    "no turn": "Argument: rotation is a quaternion of length 0: normalise it",
    "no collider": r"Argument: collider 99 does not exist \(4 in all, numbered from 0\)",
    "negative time": "Argument: seconds is -1",
    "name": "Argument: unknown name nobody",
    "zero in a name": "Argument: a name or folder has a zero",
    "empty list": "Argument: no vertex is named: give null for all",
    "targets": "Size: targets has 3 numbers: give 6",
    "no level": "Argument: level is 1, and asset 0 has 1: from_surface",
    "not pinned": "State: vertex 0 is not pinned: call ts_body_pin first",
    "snapshot": "Snapshot: 100 bytes are not a snapshot",
    "room for a snapshot": r"Size: buffer has 3 bytes: give \d+",
    "body of no world": "Handle: this body is of no world",
    "kinds": "Argument: ",
    "small overlap": "Size: bodies has room for 1",
    "radius": "Argument: radius is -1",
    "box": "Argument: size has -?nan in it",
    "no frame": "Argument: frame 99 does not exist",
    "nothing to attach": "Argument: no vertex is named: give null for all",
    "no load": "Argument: frame 99 does not exist",
    "pose of no frame": "Argument: frame 99 does not exist",
    "removed frame": "Argument: frame 0 does not exist",
    "weights": "Argument: weights",
    "no triangle": r"Argument: triangle 9999 does not exist \(\d+ in all",
    "no grab": "Argument: number is 16",
    "grab of no world": "Handle: this grab is of no world",
    "grab that was released": r"Handle: grab \d+ is not in this world, or was released",
    "callback": "from BeforeStep",
    "world destroyed in a step": r"Handle: world \d+ does not exist, or was destroyed",
    "world after Dispose": r"Handle: world \d+ does not exist, or was destroyed",
    "body after Dispose": r"Handle: world \d+ does not exist, or was destroyed",
    "scene after Dispose": r"Handle: scene \d+ does not exist, or was destroyed",
}


def test_errors_are_exceptions_with_code_and_text(export, checks, run):
    found = dict(line.split(": ", 1) for line in run(checks, export("heap"), "errors"))
    assert found.keys() == REFUSED.keys()
    for what, text in found.items():
        assert re.match(REFUSED[what], text), what


def test_a_thousand_frames_allocate_nothing(export, checks, run):
    found = dict(line.split(": ") for line in run(checks, export("heap"), "frames"))
    assert int(found["allocated by 1000 objects"]) >= 8000  # the counter counts
    assert found["allocated"] == "0"
    assert found["collections"] == "0"
    assert found["calls of BeforeStep"] == "1100"


def test_worlds_that_are_forgotten_are_given_back(export, checks, run):
    found = dict(line.split(": ") for line in run(checks, export("heap"), "lifetimes"))
    assert int(found["grown in 90 worlds [bytes]"]) < 45 * (export("heap") / "world.tsw").stat().st_size
    assert "done" in found


def test_a_second_thread_in_a_world_is_refused(export, checks, run):
    assert run(checks, export("heap"), "threads") == ["refused: True"]


def test_names_are_found_in_a_folder_with_a_name_beyond_ascii(export, checks, run, tmp_path):
    folder = tmp_path / "größe-球.softworld"
    folder.symlink_to(export("free"))
    found = run(checks, folder, "names")
    assert "Frame 0 frame0" in found
    assert len(found) == 5 + 5 + 1 + 5 + 1  # bodies, assets, a frame, meshes, the floor


@pytest.fixture
def components(compiled):
    return compiled("Components", *COMPONENTS, "stubs/UnityEngine.cs", "stubs/BehaviourChecks.cs")


def test_components_draw_a_body_in_unitys_axes(export, components, run):
    found = dict(line.split(": ") for line in run(components, export("heap", "--axes", "unity")))
    assert found["allocated"] == "0"
    assert int(found["steps"]) > 500
    assert int(found["contacts"]) > 10


TRIANGLES = {0: 184, 1: 96, 2: 28}
"""On the surface of a bar of the scene `levels`, by level: two on each outer side of a cell."""


def test_a_component_draws_the_mesh_of_the_level_that_its_body_is_at(export, components, run):
    """The program compares its meshes with those that the library reads by the names of their levels."""
    *drawn, allocated = run(components, export("levels"), "levels")
    assert drawn == [f"level {level}: {TRIANGLES[level]}" for level in (0, 2, 1, 1, 0, 2, 0, 1)]
    assert allocated == "allocated: 0"


def test_the_code_of_the_page_compiles(compiled, tmp_path):
    text = (ROOT / "docs" / "unity.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```csharp\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    assert len(blocks) == 4
    for number, block in enumerate(blocks):
        (tmp_path / f"{number}.cs").write_text(
            f"#pragma warning disable 649 // set in the inspector\n{block}"
        )
    main = tmp_path / "main.cs"
    main.write_text("class Program { static void Main() { } }")
    files = [*COMPONENTS, "stubs/UnityEngine.cs", *sorted(tmp_path.iterdir())]
    compiled("Page", *files)


def arguments(text):
    return [" ".join(each.split()) for each in text.split(",") if each.strip() not in ("", "void")]


def test_every_function_of_the_header_is_declared():
    text = re.sub(r"/\*.*?\*/", "", HEADER.read_text(encoding="utf-8"), flags=re.DOTALL)
    functions = re.findall(r"TS_API [\w *]+?(ts_\w+)\(([^)]*)\);", text)
    assert len(functions) == text.count("TS_API ") - text.count("#define TS_API ")
    source = (SOURCE / "TaichiSoft.cs").read_text(encoding="utf-8")
    declared = re.findall(r"static extern \w+ (ts_\w+)\(([^)]*)\);", source)
    assert {name for name, _ in declared} == {name for name, _ in functions}
    wanted = dict(functions)
    for name, given in declared:
        assert [kind_of_csharp(each) for each in arguments(given)] == [
            kind_of_c(each) for each in arguments(wanted[name])
        ], name


def kind_of_c(argument):
    """Name and type of an argument, in words that both languages have."""
    kind, name = re.fullmatch(r"(.*?)(\w+(?:\[\d\])?)", argument.replace("const ", "")).groups()
    kind, name = kind.strip(), re.sub(r"\[\d\]", "", name)
    if kind.endswith("*") or "[" in argument or name in ("user", "function"):
        return name, "pointer"
    if kind in ("ts_scene", "ts_world", "ts_body", "ts_grab", "ts_joint", "ts_motor"):
        return name, "u64"
    return name, {"int32_t": "i32", "double": "f64", "size_t": "size"}[kind]


def kind_of_csharp(argument):
    kind, name = argument.rsplit(" ", 1)
    if kind.startswith(("ref ", "out ")) or kind.endswith("[]") or kind in ("IntPtr", "BeforeStep"):
        return name, "pointer"
    return name, {"ulong": "u64", "int": "i32", "double": "f64", "UIntPtr": "size"}[kind]


def test_codes_and_kinds_have_the_numbers_of_the_header():
    header, source = (path.read_text(encoding="utf-8") for path in (HEADER, SOURCE / "TaichiSoft.cs"))
    for kind, prefix, count in (
        ("ErrorCode", "TS_ERROR_", 9),
        ("NameKind", "TS_", 7),
        ("BodyStatus", "TS_", 4),
        ("ShapeKind", "TS_", 4),
        ("EventKinds", "TS_", 8),
    ):
        body = re.search(rf"enum {kind}\s*{{(.*?)}}", source, re.DOTALL).group(1)
        rows = re.findall(r"^ +(\w+) = (-?\d+)", body, re.MULTILINE)
        assert len(rows) == count
        for name, number in rows:
            words = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).upper()
            assert f"{prefix}{words} = {number}" in header, name
    (version,) = re.findall(r"const uint Version = (\d+);", source)
    assert f"#define TS_VERSION {version}\n" in header
