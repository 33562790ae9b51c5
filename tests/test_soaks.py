"""The map from folders to the soaks that guard them, and which tests `pytest --since` takes."""

import subprocess
from pathlib import Path, PurePosixPath
from types import SimpleNamespace

import pytest
from soaks import SOAKS, changed_since, is_named, left_out, soaks_of

pytestmark = pytest.mark.numpy

HERE = Path(__file__).parent
ROOT = HERE.parent
WITH_CODE = ("taichi_soft", "engine_adapter", "lab")


def test_every_folder_with_code_has_its_soaks_and_every_path_exists():
    for name in WITH_CODE:
        folders = {each.parent.relative_to(ROOT).as_posix() for each in (ROOT / name).glob("*/*.*")}
        assert {each for each in folders if "__pycache__" not in each} <= set(SOAKS)
    assert [path for path in SOAKS if not (ROOT / path).exists()] == []
    named = {path for paths in SOAKS.values() for path in paths.split()}
    assert [path for path in named if not (HERE / path).exists()] == []


@pytest.mark.parametrize(
    ("file", "soak", "runs"),
    [
        ("taichi_soft/solver/kernels/flat.py", "solver/test_threads.py", True),
        ("taichi_soft/solver/kernels/flat.py", "cages/test_cage.py", False),
        ("engine_adapter/godot/src/body.cpp", "native/test_godot.py", True),
        ("engine_adapter/godot/src/body.cpp", "native/test_web.py", False),
        ("engine_adapter/budget.py", "engine_adapter/test_refused_steps.py", True),
        ("tests/cages/test_cage.py", "cages/test_cage.py", True),
        ("tests/cages/test_cage.py", "cages/test_thin.py", False),
        ("README.md", "docs/test_pages.py", False),
    ],
)
def test_a_changed_file_runs_the_soaks_of_its_folder(file, soak, runs):
    assert is_named(PurePosixPath(soak), soaks_of([file])) == runs


def test_changed_added_and_deleted_files_differ_from_a_revision(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    git = ["git", "-c", "user.name=Test", "-c", "user.email=test@localhost"]

    def commit():
        for command in (["add", "-A"], ["commit", "-qm", "Test"]):
            subprocess.run([*git, *command], check=True)

    subprocess.run([*git, "init", "-q"], check=True)
    for name in ("kept", "changed", "deleted"):
        (tmp_path / name).write_text(name)
    commit()
    (tmp_path / "changed").write_text("otherwise")
    (tmp_path / "deleted").unlink()
    (tmp_path / "added").write_text("")
    commit()
    assert changed_since("HEAD~1") == ["added", "changed", "deleted"]
    with pytest.raises(ValueError, match=r"--since HEAD~2: .*HEAD~2"):
        changed_since("HEAD~2")


def test_soaks_that_neither_always_run_nor_guard_a_change_are_left_out():
    def test(path, *markers):
        return SimpleNamespace(path=HERE / path, get_closest_marker=dict.fromkeys(markers, True).get)

    quick, always = test("cages/test_cage.py", "numpy"), test("cages/test_cage.py", "numpy", "soak", "guard")
    guards_it, guards_others = test("lab/sweep/test_store.py", "soak"), test("cages/test_cage.py", "soak")
    items = [quick, always, guards_it, guards_others]
    assert left_out(items, HERE, soaks_of(["lab/sweep/store.py"])) == [guards_others]
    assert left_out(items, HERE, soaks_of([])) == [guards_it, guards_others]
