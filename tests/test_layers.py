"""Layers: every file imports only downwards, and no two files import each other."""

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

# From the ground up. A module or package imports from its own line's package and from lines below, never from
# a neighbour on its line. Names without a prefix are parts of taichi_soft. Those not written yet are allowed.
LAYERS = """
    errors  constants  clock  signals  subnormals
    cores  turns
    types  runtime  checks  handles  sealed
    math  loading
    materials  meshing  settings  contact  plasticity
    laws  collision
    scene  contact_fields  joint_fields
    state  integrators
    kernels
    forces  shapes
    vibration
    plain  parts
    colliders
    starts
    stability  first_mode  failures  control  queries  events  cutting
    measures
    tearing  readout  substeps
    body  assets  pools
    sag  simulation
    building  spawning  structure  notes
    restoring
    snapshot
    recorder  rehearsal
    world
    taichi_soft
    render
    engine_adapter
    stages  scenery
    film  profiling  drops  replay  experiments  sweep
    report
    cli
    __main__
    demos
"""
LEVEL = {name: level for level, line in enumerate(LAYERS.split("\n")) for name in line.split()}

# The element functions of integrators are called by the kernels as laws are, and so lie below them;
# runtime is below everything that runs on Taichi, and knows errors, cores and turns only.

NO_TAICHI = ("errors", "constants", "types", "checks", "materials", "meshing", "contact", "plasticity")
"""Parts that are tested in milliseconds: numpy only."""

FACES = (
    "render",
    "stages",
    "scenery",
    "film",
    "profiling",
    "drops",
    "replay",
    "experiments",
    "sweep",
    "report",
    "cli",
    "__main__",
)
"""Parts of taichi_soft that lie above its public names."""


def module_name(path):
    """Dotted name of a file: taichi_soft/laws/__init__.py is taichi_soft.laws."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


FILES = {
    module_name(path): path
    for folder in ("taichi_soft", "engine_adapter", "demos")
    for path in sorted((ROOT / folder).rglob("*.py"))
}


def part_of(module):
    """The name in LAYERS to which a module belongs."""
    parts = module.split(".")
    if parts[0] == "taichi_soft" and len(parts) > 1:
        return parts[1]
    return parts[0]


def is_for_types_only(node):
    return isinstance(node, ast.If) and ast.unparse(node.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING")


def walk_running_code(tree):
    """All nodes but those under `if TYPE_CHECKING`, which never run."""
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        if is_for_types_only(node):
            waiting.extend(node.orelse)
        else:
            waiting.extend(ast.iter_child_nodes(node))


def imported_modules(module, source, known):
    """Absolute names of the modules that a source imports, at its top or inside functions."""
    is_package = known.get(module) is not None and known[module].name == "__init__.py"
    for node in walk_running_code(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = module.split(".")[: len(module.split(".")) - node.level + is_package]
                base = ".".join([*above, *([node.module] if node.module else [])])
            for alias in node.names:
                inner = f"{base}.{alias.name}"
                yield inner if inner in known else base


def upward_edges(module, imports):
    """Imports of a module that lie on its own level or above, outside its own package."""
    here = part_of(module)
    for name in imports:
        if name.split(".")[0] not in ("taichi_soft", "engine_adapter", "demos"):
            continue
        there = part_of(name)
        if there != here and LEVEL.get(there, 0) >= LEVEL.get(here, 0):
            yield f"{module} ({here}) imports {name} ({there})"


IMPORTS = {
    module: sorted(set(imported_modules(module, path.read_text(encoding="utf-8"), FILES)))
    for module, path in FILES.items()
}


def test_there_is_something_to_check():
    assert {"taichi_soft.world", "taichi_soft.laws", "engine_adapter.adapter"} <= set(FILES)
    assert "taichi_soft.laws.model" in IMPORTS["taichi_soft.laws.virial"] + IMPORTS["taichi_soft.laws"]
    assert "taichi_soft.kernels.program" in IMPORTS["taichi_soft.kernels.schedules"]


@pytest.mark.parametrize("module", FILES)
def test_every_file_has_a_layer(module):
    assert part_of(module) in LEVEL, f"{module}: give {part_of(module)!r} a line in LAYERS"


@pytest.mark.parametrize("module", FILES)
def test_imports_go_downwards(module):
    assert list(upward_edges(module, IMPORTS[module])) == []


def test_no_circles():
    """Between files, also within one package; `if TYPE_CHECKING` does not count."""
    graph = {
        module: {name for name in names if name in FILES} - {module} for module, names in IMPORTS.items()
    }
    try:
        list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        pytest.fail(" -> ".join(reversed(error.args[1])))


@pytest.mark.parametrize("module", FILES)
def test_only_runtime_imports_taichi(module):
    if module == "taichi_soft.runtime":
        return
    assert [name for name in IMPORTS[module] if name.split(".")[0] == "taichi"] == []


@pytest.mark.parametrize("module", FILES)
def test_ti_comes_from_runtime(module):
    """A file that says `ti.` has it from `from taichi_soft.runtime import ti`."""
    tree = ast.parse(FILES[module].read_text(encoding="utf-8"))
    uses = any(isinstance(node, ast.Name) and node.id == "ti" for node in ast.walk(tree))
    if uses and module != "taichi_soft.runtime":
        assert "taichi_soft.runtime" in IMPORTS[module]


@pytest.mark.parametrize("module", FILES)
def test_only_runtime_starts_taichi(module):
    """`ti.init` and `ti.reset` would destroy the fields of every world."""
    calls = [
        ast.unparse(node.func)
        for node in ast.walk(ast.parse(FILES[module].read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
    ]
    starts = [call for call in calls if call in ("ti.init", "ti.reset", "taichi.init", "taichi.reset")]
    assert starts == (["ti.init"] if module == "taichi_soft.runtime" else [])


@pytest.mark.parametrize("module", [name for name in FILES if part_of(name) in NO_TAICHI])
def test_meshes_and_materials_need_no_taichi(module):
    """Not through other files either."""
    reached, waiting = set(), [module]
    while waiting:
        name = waiting.pop()
        if name in reached or name not in IMPORTS:
            continue
        reached.add(name)
        waiting.extend(IMPORTS[name])
    assert "taichi_soft.runtime" not in reached


@pytest.mark.parametrize("module", [name for name in FILES if name.startswith("taichi_soft")])
def test_nobody_below_knows_the_engine_adapter(module):
    if LEVEL[part_of(module)] > LEVEL["engine_adapter"]:
        return
    assert [name for name in IMPORTS[module] if name.startswith("engine_adapter")] == []


@pytest.mark.parametrize("module", [name for name in FILES if name.startswith("engine_adapter")])
def test_the_engine_adapter_knows_only_the_public_names(module):
    """And the checks of arguments and of callers; never a face."""
    inner = {name for name in IMPORTS[module] if name.startswith("taichi_soft")}
    assert inner <= {"taichi_soft", "taichi_soft.checks", "taichi_soft.turns"}


@pytest.mark.parametrize("module", [name for name in FILES if part_of(name) == "render"])
def test_pictures_know_meshes_but_no_physics(module):
    allowed = {"render", "runtime", "errors", "types", "constants", "checks", "meshing"}
    parts = {part_of(name) for name in IMPORTS[module] if name.startswith("taichi_soft")}
    assert parts <= allowed


@pytest.mark.parametrize("module", [name for name in FILES if part_of(name) not in (*FACES, "demos")])
def test_the_simulation_needs_no_face(module):
    assert {part_of(name) for name in IMPORTS[module]} & set(FACES) == set()


# The rules above must see what they forbid.


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("taichi_soft.meshing.quality", "from taichi_soft.world import World"),
        ("taichi_soft.meshing.quality", "from ..scene import Scene"),
        ("taichi_soft.laws.virial", "import taichi_soft.kernels.flat"),
        ("taichi_soft.laws.virial", "def f():\n    from taichi_soft import state"),
        ("taichi_soft.materials.material", "from taichi_soft.meshing import TetMesh"),
        ("taichi_soft.world", "from taichi_soft import Body"),
        ("taichi_soft.world", "from engine_adapter import FixedStep"),
        ("taichi_soft.laws", "from ..kernels import flat"),
    ],
)
def test_an_upward_import_is_found(module, source):
    assert list(upward_edges(module, set(imported_modules(module, source, FILES)))) != []


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("taichi_soft.laws.virial", "from taichi_soft.math.tensors import cofactor"),
        ("taichi_soft.laws.virial", "from .hooke import hooke_stress"),
        ("taichi_soft.laws", "from .hooke import hooke_stress"),
        ("taichi_soft.body", "if TYPE_CHECKING:\n    from taichi_soft.world import World"),
        ("engine_adapter.adapter", "from taichi_soft import World"),
        ("demos.sphere", "from taichi_soft.render import Camera"),
        ("taichi_soft.world", "import numpy as np"),
    ],
)
def test_a_downward_import_is_not(module, source):
    assert list(upward_edges(module, set(imported_modules(module, source, FILES)))) == []
