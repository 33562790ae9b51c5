"""Layers: every file imports only downwards, and nobody reads what is another's own."""

import ast
import re
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

pytestmark = pytest.mark.numpy

ROOT = Path(__file__).parents[1]

# From the ground up. A package imports from itself and from lines below, whether the import runs, stands
# under TYPE_CHECKING or within a function. Names without a prefix are packages of taichi_soft.
LAYERS = """
    core
    meshing
    cages
    elements
    bodies
    control
    contact
    fracture
    levels
    queries
    events
    solver
    persistence
    world
    feel
    taichi_soft
    engine_adapter
    render
    bake
    export
    doctor
    profiling
    live
    cli
    __main__
    demos
    lab
"""
LEVEL = {name: level for level, name in enumerate(LAYERS.split())}

OURS = ("taichi_soft", "engine_adapter", "demos", "lab")

PICTURES = ("artist", "camera_moves", "demos", "film", "framing", "props", "replay", "stage", "take")
"""Files of render that know worlds; the others draw triangles."""

NO_TAICHI = (
    *(
        "taichi_soft.meshing",
        "taichi_soft.cages",
        "taichi_soft.elements.materials",
        "taichi_soft.core.errors",
    ),
    *("taichi_soft.core.constants", "taichi_soft.core.types", "taichi_soft.core.checks"),
)
"""Parts that are tested in milliseconds: numpy only."""


def module_name(path):
    """Dotted name of a file: taichi_soft/elements/laws/__init__.py is taichi_soft.elements.laws."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


FILES = {module_name(path): path for folder in OURS for path in sorted((ROOT / folder).rglob("*.py"))}
SOURCES = {module: path.read_text(encoding="utf-8") for module, path in FILES.items()}


def part_of(module):
    """The name in LAYERS to which a module belongs."""
    parts = module.split(".")
    return parts[1] if parts[0] == "taichi_soft" and len(parts) > 1 else parts[0]


def imported_modules(module, source):
    """Absolute names of the modules that a source imports, wherever it does."""
    is_package = module in FILES and FILES[module].name == "__init__.py"
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = module.split(".")[: len(module.split(".")) - node.level + is_package]
                base = ".".join([*above, *([node.module] if node.module else [])])
            for alias in node.names:
                inner = f"{base}.{alias.name}"
                yield inner if inner in FILES else base


LAZY = {"taichi_soft": {"engine_adapter"}}
"""The one import upwards: the top package hands out the names of the adapter, and imports it only when one of
them is asked for."""

IMPORTS = {
    module: sorted(set(imported_modules(module, source)) - LAZY.get(module, set()))
    for module, source in SOURCES.items()
}


def upward_edges(module, imports):
    """Imports of a module that lie above its own layer."""
    here = part_of(module)
    for name in imports:
        there = part_of(name)
        if name.split(".")[0] in OURS and LEVEL[there] > LEVEL[here]:
            yield f"{module} ({here}) imports {name} ({there})"


def others_names(source):
    """Return private names of other objects and modules that a source reads.

    These are `x._y` if nothing in the file is called `_y`. Names of other projects are omitted.
    """
    nodes = list(ast.walk(ast.parse(source)))
    own = {node.name for node in nodes if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
    own |= {
        node.target.id
        for node in nodes
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)
    }
    foreign = {
        alias.asname or alias.name.split(".")[0]
        for node in nodes
        if isinstance(node, (ast.Import, ast.ImportFrom))
        for alias in node.names
        if (module := getattr(node, "module", None) or alias.name).split(".")[0] not in OURS
        or module == "taichi_soft.core.taichi_workarounds.importing"  # Taichi, as it is imported there
    }
    own |= {
        node.attr
        for node in nodes
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "self"
    }
    for node in nodes:
        if isinstance(node, ast.Attribute) and node.attr.startswith("_") and not node.attr.startswith("__"):
            root = ast.unparse(node.value)
            if node.attr not in own and root not in ("self", "cls") and root.split(".")[0] not in foreign:
                yield node.attr
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in OURS:
            yield from (alias.name for alias in node.names if alias.name.startswith("_"))


def found_in(modules, rule):
    """Return the violations of a rule as one text."""
    return "\n".join(str(each) for module in modules for each in rule(module))


def test_there_is_something_to_check():
    assert {"taichi_soft.world.world", "taichi_soft.elements.laws", "engine_adapter.adapter"} <= set(FILES)
    assert "taichi_soft.elements.laws.force_model" in IMPORTS["taichi_soft.elements.kernels.elastic"]
    assert "taichi_soft.bodies.law_program" in IMPORTS["taichi_soft.solver.program"]


def test_every_file_has_a_layer():
    assert [module for module in FILES if part_of(module) not in LEVEL] == []


def test_imports_go_downwards():
    assert found_in(FILES, lambda module: upward_edges(module, IMPORTS[module])) == ""


@pytest.mark.parametrize("first", ["taichi_soft", "engine_adapter"])
def test_the_adapters_names_are_in_both_packages_whichever_is_imported_first(first):
    program = f"""
import sys
import {first}
import taichi_soft
if {first!r} == "taichi_soft":
    assert "engine_adapter" not in sys.modules, "it is imported before it is asked for"
assert not hasattr(taichi_soft, "Adapter")
from taichi_soft import EngineAdapter
import engine_adapter
assert all(getattr(taichi_soft, name) is getattr(engine_adapter, name) for name in engine_adapter.__all__)
assert set(engine_adapter.__all__) <= set(taichi_soft.__all__)
"""
    subprocess.run([sys.executable, "-c", program], check=True)


def test_what_is_installed_does_not_know_the_lab():
    """Programs that the package starts do not import the lab, and neither do later imports."""
    naming = re.compile(r"""^\s*(?:from|import) lab\b|["']lab(?:\.[\w.]+)?["']""", re.MULTILINE)
    installed = {m: s for m, s in SOURCES.items() if part_of(m) != "lab"}
    assert len(installed) > 500
    assert [module for module, source in installed.items() if naming.search(source)] == []
    assert naming.search('PROGRAM = """\nfrom lab.sweep import Store\n"""')
    assert naming.search('import_module("lab.report")')


def test_no_circles():
    """There are no circular imports between files, even within one package."""
    graph = {
        module: {name for name in names if name in FILES} - {module} for module, names in IMPORTS.items()
    }
    try:
        list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        pytest.fail(" -> ".join(reversed(error.args[1])))


def test_the_workarounds_for_taichi_are_applied_before_anybody_uses_it():
    """One file imports Taichi, and only the runtime imports from the folder of this file.

    All other files import `ti` from the runtime.
    """
    folder, runtime = "taichi_soft.core.taichi_workarounds", "taichi_soft.core.runtime"
    importing = [m for m in FILES if any(name.split(".")[0] == "taichi" for name in IMPORTS[m])]
    assert importing == [f"{folder}.importing"]
    others = [module for module in FILES if not module.startswith(folder)]
    assert [m for m in others if any(name.startswith(folder) for name in IMPORTS[m])] == [runtime]
    for module in others:
        uses = any(
            isinstance(node, ast.Name) and node.id == "ti" for node in ast.walk(ast.parse(SOURCES[module]))
        )
        assert not uses or module == runtime or runtime in IMPORTS[module], module


def test_each_workaround_for_taichi_names_what_makes_it_unnecessary():
    """The condition is at the end of its docstring."""
    folder = "taichi_soft.core.taichi_workarounds."
    named = {
        module: "unnecessary" in (ast.get_docstring(ast.parse(SOURCES[module])) or "").split("\n\n")[-1]
        for module in FILES
        if module.startswith(folder)
    }
    assert len(named) > 5
    assert [module for module, is_named in named.items() if not is_named] == []


def test_only_runtime_starts_taichi():
    """`ti.init` and `ti.reset` would destroy the fields of every world."""
    starts = {
        (module, ast.unparse(node.func))
        for module, source in SOURCES.items()
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Call)
        and ast.unparse(node.func) in ("ti.init", "ti.reset", "taichi.init", "taichi.reset")
    }
    assert starts == {("taichi_soft.core.runtime", call) for call in ("ti.init", "ti.reset")}  # at its end


def test_meshes_and_materials_need_no_taichi():
    """They do not import Taichi through other files, either."""
    reached, waiting = set(), [name for name in FILES if name.startswith(NO_TAICHI)]
    assert len(waiting) > 30
    while waiting:
        name = waiting.pop()
        if name not in reached and name in IMPORTS:
            reached.add(name)
            waiting.extend(IMPORTS[name])
    assert "taichi_soft.core.runtime" not in reached


def test_the_engine_adapter_knows_only_the_public_names():
    """And checks of arguments and callers, the error for a missing extra, and the warning for an old name."""
    tools = {"engine_adapter.native.write_fields"}  # only a checkout runs it
    inner = {n for m in FILES if m.startswith("engine_adapter") and m not in tools for n in IMPORTS[m]}
    known = {name for name in inner if name.startswith("taichi_soft")}
    known_core = {"checks", "extras", "handles", "renamed", "threads"}
    assert known <= {"taichi_soft", *(f"taichi_soft.core.{name}" for name in known_core)}


def test_pictures_know_meshes_but_no_physics():
    drawing = [m for m in FILES if part_of(m) == "render" and m.split(".")[-1] not in PICTURES]
    assert len(drawing) > 10
    parts = {part_of(n) for m in drawing for n in IMPORTS[m] if n.startswith("taichi_soft")}
    assert parts <= {"render", "core", "meshing"}


def test_nobody_reads_what_is_anothers_own():
    assert (
        found_in(FILES, lambda module: (f"{module}: {name}" for name in others_names(SOURCES[module]))) == ""
    )


# The rules above must see what they forbid.


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("taichi_soft.meshing.quality", "from taichi_soft.world.world import World"),
        ("taichi_soft.meshing.quality", "from ..world.world import World"),
        ("taichi_soft.elements.laws.virial", "import taichi_soft.solver.kernels.flat"),
        ("taichi_soft.elements.laws.virial", "def f():\n    from taichi_soft.solver import state"),
        ("taichi_soft.bodies.slots", "if TYPE_CHECKING:\n    from taichi_soft.world.body import Body"),
        ("taichi_soft.world.world", "from taichi_soft import Body"),
        ("taichi_soft.world.world", "from engine_adapter import FixedStep"),
        ("taichi_soft.cli.app", "from lab.cli.report import report"),
        ("demos.compare", "def f():\n    import lab.peers"),
        ("taichi_soft.elements.laws", "from ...solver.kernels import flat"),
    ],
)
def test_an_upward_import_is_found(module, source):
    assert list(upward_edges(module, set(imported_modules(module, source)))) != []


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("taichi_soft.elements.laws.virial", "from taichi_soft.core.math.tensors import cofactor"),
        ("taichi_soft.elements.laws.virial", "from .hooke import hooke_stress"),
        ("taichi_soft.world.body", "if TYPE_CHECKING:\n    from taichi_soft.world.world import World"),
        ("engine_adapter.adapter", "from taichi_soft import World"),
        ("demos.sphere", "from taichi_soft.render import Camera"),
        ("lab.peers.wall", "from taichi_soft.render import Camera"),
        ("taichi_soft.world.world", "import numpy as np"),
    ],
)
def test_a_downward_import_is_not(module, source):
    assert list(upward_edges(module, set(imported_modules(module, source)))) == []


@pytest.mark.parametrize(
    "source", ["def f(body):\n    return body._part", "from taichi_soft.core.threads import _taichi"]
)
def test_reading_what_is_anothers_own_is_found(source):
    assert list(others_names(source)) != []


@pytest.mark.parametrize(
    "source",
    [
        "class A:\n    def f(self, other):\n        self._x = other._x",
        "def _f(): ...\nm._f",
        "import os\nos._exit(0)",
        "class A:\n    _n: int\ndef number(a):\n    return a._n",
        "x.__class__",
        "x.y",
    ],
)
def test_reading_ones_own_is_not(source):
    assert list(others_names(source)) == []
