"""Code on the pages of the documentation runs, and links lead to existing targets."""

import ast
import functools
import importlib
import re
import subprocess
import sys
import warnings
from enum import EnumMeta
from pathlib import Path

import pytest
from typer.main import get_command

import engine_adapter
import taichi_soft
from lab.cli.app import app as lab_app
from taichi_soft import LAWS, PRESETS
from taichi_soft.cli.app import app
from taichi_soft.core.extras import EXTRAS
from taichi_soft.core.types import DampingModel, Flips, Integrator, Strain
from taichi_soft.render.demos import demo_names

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
MADE = {
    "contributing.md": "CONTRIBUTING.md",
    "changelog.md": "CHANGELOG.md",
    "report/full.html": "docs/report/report.md",
}
"""Pages that docs/site_hooks.py makes, and of what."""
PAGES = {
    path.relative_to(DOCS).as_posix(): path.read_text(encoding="utf-8") for path in sorted(DOCS.rglob("*.md"))
}
CODE = {
    name: re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE) for name, text in PAGES.items()
}
PUBLIC = (
    *("taichi_soft", "taichi_soft.bake", "taichi_soft.export", "taichi_soft.live"),
    *("engine_adapter", "engine_adapter.panda3d", "taichi_soft.render", "taichi_soft.render.film"),
)
"""Modules of which a page may import the public names."""
LINK = re.compile(r"\]\(([^)\s]+)\)")


def pages(names):
    """Return pages as parameters; those whose code imports Panda3D need it."""
    return [
        pytest.param(name, marks=pytest.mark.needs("panda3d")) if name.startswith("panda3d") else name
        for name in names
    ]


def prose(name):
    """A page without its code."""
    return re.sub(r"^```.*?^```", "", PAGES[name], flags=re.DOTALL | re.MULTILINE)


def slug(heading):
    """The anchor that MkDocs gives a heading."""
    kept = re.sub(r"[^\w\s-]", "", heading.replace("`", "")).strip().lower()
    return re.sub(r"[-\s]+", "-", kept)


@pytest.mark.guard
@pytest.mark.soak
@pytest.mark.parametrize("name", pages(name for name, blocks in CODE.items() if blocks))
def test_the_code_of_a_page_runs_from_top_to_bottom(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names: dict = {"__name__": "page"}
    with warnings.catch_warnings():
        warnings.simplefilter("error", taichi_soft.FrozenBodyWarning)
        warnings.simplefilter("error", taichi_soft.UnstableStepWarning)
        for number, block in enumerate(CODE[name]):
            exec(compile(block, f"docs/{name}, block {number}", "exec"), names)


@pytest.mark.parametrize("name", PAGES)
def test_every_link_within_the_site_leads_somewhere(name):
    for target in LINK.findall(prose(name)):
        if re.match(r"https?:", target):
            continue
        path, _, anchor = target.partition("#")
        found = (DOCS / name).parent / path if path else DOCS / name
        made = (
            MADE.get(found.resolve().relative_to(DOCS).as_posix())
            if DOCS in found.resolve().parents
            else None
        )
        found = ROOT / made if made else found
        assert found.exists(), f"{name}: {target}"
        if anchor and found.suffix == ".md":
            text = re.sub(
                r"^```.*?^```", "", found.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE
            )
            slugs = {slug(heading) for heading in re.findall(r"^#+ (.*)$", text, re.MULTILINE)}
            assert anchor in slugs | set(re.findall(r'<a id="([^"]+)"', text)), f"{name}: {target}"


def test_every_page_is_in_the_navigation():
    navigation = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").split("\nnav:\n")[1].split("\n\n")[0]
    listed = set(re.findall(r"[\w/-]+\.md", navigation))
    assert listed == (set(PAGES) - {"report/report.md"}) | {name for name in MADE if name.endswith(".md")}


@functools.cache
def help_of(module, *command):
    done = subprocess.run([sys.executable, "-m", module, *command, "--help"], capture_output=True, text=True)
    return done.stdout


PROGRAMS = {
    "taichi-soft": ("taichi_soft", "bake|demo|film|info|profile|replay"),
    "python -m lab": ("lab", "report|drop-test|peers"),
}
"""Modules of command lines, and commands of which a page may name options."""


@pytest.mark.guard
@pytest.mark.soak
@pytest.mark.parametrize("name", sorted(PAGES))
def test_every_command_and_option_of_a_page_exists(name):
    text = PAGES[name]
    for program, (module, commands) in PROGRAMS.items():
        for command, rest in re.findall(rf"{program} ({commands})\b([^`\n|]*)", text):
            for option in re.findall(r"(?<!\S)--[a-z-]+", rest):
                assert option in help_of(module, command), f"{name}: {program} {command} {option}"
        for command in re.findall(rf"^ {{4}}{program} ([\w-]+)|`{program} ([\w-]+)", text, re.MULTILINE):
            assert f"\n  {''.join(command)} " in help_of(module), name
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"^ +make ([\w-]+)|`make ([\w-]+)`", text, re.MULTILINE):
        assert f"\n{''.join(target)}:" in makefile, name


@pytest.mark.parametrize("package", [taichi_soft, engine_adapter])
def test_every_public_name_is_on_a_page_of_the_reference_once(package):
    text = "\n".join(text for name, text in PAGES.items() if name.startswith("reference/"))
    listed = re.findall(rf"^::: {package.__name__}\.(\w+)$", text, re.MULTILINE)
    elsewhere = engine_adapter.__all__ if package is taichi_soft else ()
    assert sorted(listed) == sorted(set(package.__all__) - set(elsewhere))


def test_every_public_name_for_films_is_in_the_reference_once():
    modules = [importlib.import_module(name) for name in ("taichi_soft.render", "taichi_soft.render.film")]
    listed = re.findall(
        r"^::: taichi_soft\.render\.(?:film\.)?(\w+)$", PAGES["reference/films.md"], re.MULTILINE
    )
    named = {name: getattr(module, name) for module in modules for name in module.__all__}
    kinds = {name for name, each in named.items() if isinstance(each, EnumMeta)}  # strings, in the text
    assert sorted(listed) == sorted(named.keys() - kinds)


@pytest.mark.parametrize(
    ("page", "names"),
    [
        ("materials.md", LAWS),
        ("materials.md", PRESETS),
        ("command-line.md", demo_names()),
        ("first-steps.md", EXTRAS),
        *(("materials.md", [each.value for each in kind]) for kind in (Strain, Flips, DampingModel)),
        ("game-loop.md", [each.value for each in Integrator]),
    ],
)
def test_every_choice_stands_in_its_table(page, names):
    for name in names:
        assert re.search(rf"^\|.*`\"?{name}\"?`", PAGES[page], re.MULTILINE), name


@pytest.mark.guard
@pytest.mark.soak
@pytest.mark.parametrize(("program", "its_app"), [("taichi-soft", app), ("python -m lab", lab_app)])
def test_every_command_stands_in_the_table_of_commands(program, its_app):
    rows = re.findall(rf"^\| `{program} ([\w-]+)[^`]*` \|", PAGES["command-line.md"], re.MULTILINE)
    commands = get_command(its_app).commands.items()
    assert [name for name, command in commands if not command.hidden and name not in rows] == []


def test_presets_have_the_numbers_of_the_table():
    rows = dict(
        re.findall(
            r'^\| `"(\w+)"` \| ([\d.]+ MPa \| -?[\d.]+ \| \d+ kg/m\^3 \| [\d.]+)',
            PAGES["materials.md"],
            re.MULTILINE,
        )
    )
    said = {
        name: f"{m.young / 1e6:g} MPa | {m.poisson:g} | {m.density:g} kg/m^3 | {m.damping_ratio:g}"
        for name, m in PRESETS.items()
    }
    assert rows == said


@pytest.mark.parametrize("name", pages(PAGES))
def test_code_of_a_page_imports_public_names_only(name):
    for block in CODE[name]:
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.ImportFrom) and node.module in PUBLIC:
                assert {each.name for each in node.names} <= set(importlib.import_module(node.module).__all__)
            elif isinstance(node, ast.ImportFrom):
                assert not (node.module or "").startswith(("taichi_soft", "engine_adapter"))
