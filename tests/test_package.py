"""What is installed: the extras, and a wheel in which everything works without a checkout."""

import re
import subprocess
import sys
import tarfile
import zipfile
from importlib.metadata import requires, version
from pathlib import Path

import pytest

import lab.extras
from taichi_soft import OptionError, cli
from taichi_soft.core import extras
from taichi_soft.core.package_data import ASSETS, DEMOS

ROOT = Path(__file__).resolve().parents[1]
CORE = ("taichi", "numpy", "trimesh")
MESHERS = ("tetgen", "ftetwild")
APART = (*MESHERS, "export")
"""Extras of the library that are not in `all`."""


def packages_of(extra):
    """Return the packages of an extra as the installed package declares them, including nested extras."""
    found = set()
    for line in requires("taichi-soft"):
        need, _, condition = line.partition(";")
        if f"extra == '{extra}'" in condition.replace('"', "'"):
            name = re.match(r"[\w.-]+", need.strip()).group()
            within = re.search(r"\[(.*)\]", need)
            nested = within.group(1).split(",") if name == "taichi-soft" and within else []
            found |= set().union(*map(packages_of, nested)) if nested else {name}
    return found


def test_without_an_extra_a_game_installs_taichi_numpy_and_trimesh():
    assert {re.match(r"[\w.-]+", line).group() for line in requires("taichi-soft") if ";" not in line} == set(
        CORE
    )


@pytest.mark.parametrize("extra", [*extras.EXTRAS, *lab.extras.EXTRAS])
def test_an_extra_installs_the_packages_that_are_asked_for(extra):
    asked = set({**extras.EXTRAS, **lab.extras.EXTRAS}[extra].values())
    assert asked <= packages_of(extra)
    assert packages_of(extra) <= packages_of("dev")
    if extra not in (*APART, *lab.extras.EXTRAS):
        assert packages_of(extra) <= packages_of("all")


def test_what_a_game_is_shipped_with_holds_no_mesher_or_engine_of_others():
    """TetGen is under the AGPL, fTetWild has no wheels for some machines. Engines and compilers are large."""
    apart = set().union(*map(packages_of, (*APART, "peers"))) - packages_of("cli")
    assert packages_of("all").isdisjoint(apart)


def test_what_a_game_is_shipped_with_is_what_the_library_asks_for():
    """Nothing is there for the lab alone, which a wheel has not."""
    asked = set().union(*(extras.EXTRAS[extra].values() for extra in extras.EXTRAS if extra not in APART))
    assert packages_of("all") == asked


def test_the_core_imports_no_package_of_an_extra():
    code = """
import importlib, pkgutil, sys

class Missing:
    def find_spec(self, name, *_):
        if name.partition(".")[0] in OPTIONAL:
            raise ImportError(name)

OPTIONAL = set(%r)
sys.meta_path.insert(0, Missing())
import engine_adapter, taichi_soft
for found in pkgutil.walk_packages(taichi_soft.__path__, "taichi_soft."):
    apart = found.name.split(".")[1] in ("render", "cli", "live", "demos", "__main__")
    if not apart and found.name != "taichi_soft.profiling.profile_tables":
        importlib.import_module(found.name)
world = taichi_soft.World()
world.add_body(taichi_soft.box(), taichi_soft.Material(2e5, 0.3, 1000), position=(0, 0, 1))
print("imported")
"""
    optional = [module for modules in extras.EXTRAS.values() for module in modules]
    done = subprocess.run([sys.executable, "-c", code % optional], capture_output=True, text=True)
    assert done.stdout.strip().endswith("imported"), done.stderr


def test_a_missing_package_is_one_line_with_the_way_to_get_it(monkeypatch, capsys):
    monkeypatch.setattr(
        extras, "find_spec", lambda name: None if name in ("PIL", "pygltflib", "skfem", "typer") else name
    )
    with pytest.raises(OptionError, match=r"pillow, pygltflib.*'taichi-soft\[bake\]'"):
        extras.require_extra("bake", "a clip needs")
    with pytest.raises(ImportError):
        extras.require_extra("bake", "a clip needs")
    with pytest.raises(OptionError, match=r"scikit-fem.*pip install -e '\.\[lab\]'"):
        lab.extras.require_report()
    with pytest.raises(SystemExit) as ended:
        cli.main("info")
    assert ended.value.code == (
        "error: the command line needs typer, not installed here: run pip install 'taichi-soft[cli]'"
    )


def test_an_adapter_of_an_engine_that_is_not_installed_names_its_extra():
    code = """
import sys
sys.modules["panda3d"] = None
try:
    import engine_adapter.panda3d
except ImportError as error:
    print(type(error).__name__, error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == (
        "MissingExtraError engine_adapter.panda3d needs panda3d, not installed here: "
        "run pip install 'taichi-soft[panda3d]'"
    ), done.stderr


def test_the_changelog_begins_with_this_version():
    heading = re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert heading.group(1) == version("taichi-soft").partition(".dev")[0]


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The wheel and the source archive of this checkout, the wheel made from the archive."""
    folder = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder), str(ROOT)]
    subprocess.run(command, check=True, capture_output=True)
    (wheel,), (archive,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    return wheel, archive


@pytest.mark.guard
@pytest.mark.soak
def test_a_source_archive_holds_every_file_of_the_checkout(built):
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    with tarfile.open(built[1]) as archive:
        held = {name.partition("/")[2] for name in archive.getnames()}
    assert set(listed.split("\n")) - {""} - held == set()


@pytest.mark.guard
@pytest.mark.soak
def test_a_wheel_works_without_the_checkout(built, tmp_path):
    wheel, _ = built
    with zipfile.ZipFile(wheel) as files:
        files.extractall(tmp_path / "site")
        description = files.read(
            next(name for name in files.namelist() if name.endswith("METADATA"))
        ).decode()
    assert {each.name for each in (tmp_path / "site").iterdir() if each.suffix != ".dist-info"} == {
        *("taichi_soft", "engine_adapter")
    }
    assert not (tmp_path / "site/taichi_soft/lab").exists()
    assert {each.name for each in (tmp_path / "site/taichi_soft/demos").glob("*.py")} == {
        each.name for each in DEMOS.glob("*.py")
    }
    assert {each.name for each in (tmp_path / "site/taichi_soft/assets").glob("*.[ng]*")} == {
        each.name for each in ASSETS.glob("*.[ng]*")
    }
    assert (
        re.findall(r"\]\((?!https?:)[^)]*\)", description) == []
    )  # on a package index they would lead nowhere

    def run(*arguments):
        code = f"import sys; sys.path.insert(0, {str(tmp_path / 'site')!r})\n"
        code += "from taichi_soft.cli import main\nmain()"
        command = [sys.executable, "-c", code, *arguments]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert "bounce" in run("demo")
    run("demo", "bounce", "--seconds", "0.1", "--size", "64x48", "--out", "b.webm")
    assert (tmp_path / "b.webm").stat().st_size > 0
