"""The API reference: every parameter is described, defaults are values, and examples run."""

import dataclasses
import importlib
import inspect
import re
import sys
import textwrap
import warnings
from pathlib import Path

import pytest
import trimesh

import taichi_soft

ROOT = Path(__file__).resolve().parents[2]
PAGES = [path.read_text(encoding="utf-8") for path in sorted((ROOT / "docs/reference").glob("*.md"))]
NAMES = [name for text in PAGES for name in re.findall(r"^::: ([\w.]+)$", text, re.MULTILINE)]
FEWEST_EXAMPLES = 20


def found(name):
    module, _, last = name.rpartition(".")
    return getattr(importlib.import_module(module), last)


def entries(docstring):
    """Names that the list of arguments or attributes of a docstring describes."""
    text = inspect.cleandoc(docstring or "") + "\n"
    names = set()
    for section in re.findall(r"^(?:Args|Attributes):\n((?: {4}.*\n|\n)*)", text, re.MULTILINE):
        for row in re.findall(r"^ {4}(\w[\w, ]*?):\s\S", section, re.MULTILINE):
            names |= {name.strip() for name in row.split(",")}
    return names


def is_made_by_users(cls):
    return not (cls.__init__.__doc__ or "").startswith("Use `")


def fields_without_a_comment(cls):
    """Return the fields of a dataclass that have no comment."""
    text = "\n".join(inspect.getsource(each) for each in cls.__mro__ if dataclasses.is_dataclass(each))
    fields = [field.name for field in dataclasses.fields(cls) if field.init]
    return [name for name in fields if not re.search(rf"^    {name}: .*# \S", text, re.MULTILINE)]


def public_methods(cls):
    """Functions of a class that are ours, with those that it inherits."""
    for name in dir(cls):
        member = inspect.getattr_static(cls, name)
        function = member.__func__ if isinstance(member, (staticmethod, classmethod)) else member
        is_ours = (getattr(function, "__module__", "") or "").startswith(("taichi_soft", "engine_adapter"))
        if inspect.isfunction(function) and is_ours and not name.startswith("_"):
            yield name, function


def undescribed(name):
    """Parameters of a name, and of its methods, that are not described where they are passed."""
    thing = found(name)
    functions = {} if inspect.isclass(thing) or not callable(thing) else {name: thing}
    if inspect.isclass(thing) and not issubclass(thing, Exception):
        functions = {f"{name}.{method}": function for method, function in public_methods(thing)}
        if dataclasses.is_dataclass(thing) and not entries(thing.__doc__):
            yield from (f"{name}: {field}" for field in fields_without_a_comment(thing))
        elif is_made_by_users(thing):
            functions[name] = thing
    for label, function in functions.items():
        described = entries(function.__doc__)
        if inspect.isclass(function) and "__init__" in vars(function):
            described |= entries(function.__init__.__doc__)
        parameters = set(inspect.signature(function).parameters) - {"self", "cls"}
        yield from (f"{label}: {each}" for each in sorted(parameters - described))


@pytest.mark.parametrize("name", NAMES)
def test_every_parameter_is_described_where_it_is_passed(name):
    if ".panda3d." in name:
        pytest.importorskip("panda3d")
    assert list(undescribed(name)) == []


def test_the_first_page_lists_all_others():
    index = (ROOT / "docs/reference/index.md").read_text(encoding="utf-8")
    pages = {path.name for path in (ROOT / "docs/reference").glob("*.md")} - {"index.md"}
    assert pages == set(re.findall(r"^\| \[[^]]+\]\((\w+\.md)\) \| \S", index, re.MULTILINE))


def test_a_parameter_that_is_not_described_is_found(monkeypatch):
    monkeypatch.setattr(taichi_soft.World.step, "__doc__", "Step.\n\nArgs:\n    dt: length [s].\n")
    assert list(undescribed("taichi_soft.World")) == ["taichi_soft.World.step: substeps"]


@pytest.fixture(scope="module")
def read():
    """Return the two packages as the site reads them."""
    griffe = pytest.importorskip("griffe")
    sys.path.insert(0, str(ROOT / "docs"))
    try:
        from docstring_sections import DocstringSections
    finally:
        sys.path.pop(0)
    extensions = griffe.load_extensions(DocstringSections)
    loader = griffe.GriffeLoader(search_paths=[ROOT], extensions=extensions)
    for package in ("taichi_soft", "engine_adapter"):
        loader.load(package)
    loader.resolve_aliases()
    return loader.modules_collection


def functions_of(thing):
    thing = thing.final_target if thing.is_alias else thing
    members = thing.all_members.values() if thing.is_class else [thing]
    for member in members:
        target = member.final_target if member.is_alias else member
        if target.is_function and (target.name == "__init__" or not target.name.startswith("_")):
            yield target


def test_defaults_are_printed_as_values(read):
    printed = {}
    for name in NAMES:
        for function in functions_of(read[name]):
            for parameter in function.parameters:
                printed[f"{name}.{function.name} {parameter.name}"] = str(parameter.default)
    assert [key for key, text in printed.items() if re.search(r"\b[A-Z][A-Z_]+\b|\b[A-Z]\w+\.\w", text)] == []
    assert printed["taichi_soft.World.__init__ integrator"] == "'leapfrog'"
    assert printed["taichi_soft.World.__init__ gravity"] == "(0.0, 0.0, -9.81)"
    assert printed["taichi_soft.World.add_body contact"] == "Contact()"
    assert printed["taichi_soft.Material.__init__ damping_ratio"] == "0.05"
    assert printed["taichi_soft.cloth.cloth springs"] == "('tensile', 'shear', 'bend')"
    assert printed["taichi_soft.World.add_collider friction"] == "0.5"


def test_what_only_a_world_makes_has_no_signature(read):
    for name in ("taichi_soft.Body", "taichi_soft.Collider", "taichi_soft.Grab"):
        inits = [each for each in functions_of(read[name]) if each.name == "__init__"]
        assert inits == []


def examples():
    """Code under `Example:`, by the name that it belongs to."""
    code = {}
    for name in NAMES:
        if ".panda3d." in name:
            continue
        thing = found(name)
        docs = {name: thing.__doc__} if callable(thing) else {}
        if inspect.isclass(thing):
            docs |= {f"{name}.{method}": function.__doc__ for method, function in public_methods(thing)}
        for label, text in docs.items():
            match = re.search(
                r"^Example:\n((?: {4}.*\n|\n)+)", inspect.cleandoc(text or "") + "\n", re.MULTILINE
            )
            if match:
                code[label] = textwrap.dedent(match[1])
    return code


EXAMPLES = examples()
(PREAMBLE,) = re.findall(
    r"^```python\n(.*?)^```", (ROOT / "docs/reference/index.md").read_text(), re.DOTALL | re.MULTILINE
)


def test_there_are_examples_of_what_is_used_most():
    assert len(EXAMPLES) >= FEWEST_EXAMPLES
    assert max(len(code.splitlines()) for code in EXAMPLES.values()) <= 8


@pytest.fixture(scope="module")
def names(tmp_path_factory):
    """Return the names that examples can use, after the code on the first page of the reference."""
    made = {"__name__": "example", "folder": tmp_path_factory.mktemp("examples")}
    trimesh.creation.torus(0.5, 0.2).export(made["folder"] / "duck.glb")
    exec(compile(PREAMBLE, "docs/reference/index.md", "exec"), made)
    return made | {"beginning": made["world"].snapshot()}


@pytest.mark.guard
@pytest.mark.soak
@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_runs(name, names, monkeypatch):
    monkeypatch.chdir(names["folder"])
    names["world"].restore(names["beginning"])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        exec(compile(EXAMPLES[name], f"example of {name}", "exec"), dict(names))
    assert not any(body.is_frozen for body in names["world"].bodies)
