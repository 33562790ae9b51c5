"""The nodes for Godot 4: no Godot compiled them, so their words are looked up in Godot's own lists."""

import re

import pytest
from godot4_host import VERSIONS, registered
from godot_build import files_of
from native_build import ROOT

pytestmark = pytest.mark.soak

PROJECT = files_of(4)
OF_GDSCRIPT = {"Variant", "PI", "TAU", "INF", "NAN", "load", "preload", "range", "len"}
OF_GLTF = {"bufferViews", "bufferView", "images", "byteLength", "mimeType"}


def page_script():
    text = (ROOT / "docs" / "godot4.md").read_text(encoding="utf-8")
    (script,) = re.findall(r"^```gdscript\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    return f"extends Node3D\n\n{script}"


def scripts():
    """Texts of all scripts, by name."""
    found = {path.split("/")[-1]: text for path, text in PROJECT.items() if path.endswith(".gd")}
    assert len(found) == 4
    return {**found, "page": page_script()}


def bare(text):
    """A script without what is in quotes, comments and paths of nodes."""
    return re.sub(r'"[^"\n]*"|#.*|\$[\w/]+', '""', text)


def functions_of(text):
    """Return the number of arguments of each function in a script."""
    found = re.findall(r"^func (\w+)\((.*?)\)", text, re.MULTILINE)
    return {name: len([each for each in arguments.split(",") if each]) for name, arguments in found}


def variables_of(text):
    return set(re.findall(r"^(?:@\w+(?:\(.*\))? )?(?:var|const) (\w+)", text, re.MULTILINE))


def names_of(entry):
    """Names of an entry of Godot's list and of what it has; not of arguments."""
    found = {entry["name"]}
    for kind in ("methods", "properties", "members", "signals", "constants", "enums", "values"):
        found |= set().union(*(names_of(each) for each in entry.get(kind, ())))
    return found


def chain(api, name):
    """A class and those that it inherits."""
    classes = {each["name"]: each for each in api["classes"]}
    while name in classes:
        yield classes[name]
        name = classes[name].get("inherits")


def members(api, base, kind):
    return {each["name"]: each for one in chain(api, base) for each in one.get(kind, ())}


@pytest.mark.parametrize("name", scripts())
def test_scripts_are_gdscript_2(name):
    parser = pytest.importorskip("gdtoolkit.parser", reason="needs gdtoolkit: make setup").parser
    parser.parse(scripts()[name])


@pytest.mark.parametrize("version", VERSIONS)
def test_scripts_use_names_that_are_there(api, host, version):
    told = api[version]
    lists = ("builtin_classes", "classes", "global_enums", "utility_functions", "singletons")
    theirs = OF_GDSCRIPT.union(*(names_of(each) for name in lists for each in told[name]))
    functions = {each["name"] for each in told["utility_functions"] + told["builtin_classes"]} | OF_GDSCRIPT
    texts = {name: bare(text) for name, text in scripts().items()}
    ours = {"SoftWorldNative", *registered(host), *OF_GLTF}
    for text in texts.values():
        ours |= set(re.findall(r"\b(?:class_name|signal|enum|var|const|func|for) (\w+)", text))
        for values in re.findall(r"^enum \w+ \{(.*)\}", text, re.MULTILINE):
            ours |= set(re.findall(r"\w+", values))
    ours |= set(re.findall(r'"(\w+)": ', "".join(scripts().values())))  # keys of dictionaries
    for name, text in texts.items():
        (base,) = re.findall(r"^extends (\w+)", text, re.MULTILINE)
        inherited = members(told, base, "methods").keys()
        used = set(re.findall(r"\.([a-z]\w*)|\b([A-Z]\w*)", text))
        for word in {a or b for a, b in used}:
            assert word in theirs | ours, f"{name}: {word}"
        for word in re.findall(r"(?<![.@\w])(?<!signal )([a-z_]\w*)\(", text):
            assert word in functions | inherited | functions_of(text).keys(), f"{name}: {word}()"


@pytest.mark.parametrize("version", VERSIONS)
def test_scripts_redefine_nothing_of_their_base(api, version):
    """Godot refuses a script that does."""
    for name, text in scripts().items():
        (base,) = re.findall(r"^extends (\w+)", text, re.MULTILINE)
        methods = members(api[version], base, "methods")
        taken = {**methods, **members(api[version], base, "properties")}
        taken |= members(api[version], base, "signals")
        assert not variables_of(text) & taken.keys(), name
        assert not set(re.findall(r"^signal (\w+)", text, re.MULTILINE)) & taken.keys(), name
        for function, count in functions_of(text).items():
            if function in taken:
                assert methods[function]["is_virtual"], f"{name}: {function}"
                assert len(methods[function].get("arguments", ())) == count, f"{name}: {function}"


def arguments_of(text, start):
    """How many arguments a call has, whose bracket opens before `start`."""
    depth, count, any_there = 1, 0, False
    for sign in text[start:]:
        depth += (sign in "([{") - (sign in ")]}")
        if depth == 0:
            return count + any_there
        any_there = any_there or not sign.isspace()
        count += sign == "," and depth == 1
    raise AssertionError("a bracket is not closed")


def test_scripts_call_the_library_with_as_many_arguments_as_it_takes(host):
    taken = registered(host)
    called = set()
    for name, text in scripts().items():
        for found in re.finditer(r"\b(?:native|fresh)\.(\w+)\(", text):
            method = found.group(1)
            assert arguments_of(text, found.end()) == taken.get(method), f"{name}: {method}"
            called.add(method)
    assert len(called) > 20


@pytest.mark.parametrize("version", VERSIONS)
def test_the_scene_has_classes_and_properties_that_are_there(api, version):
    text = PROJECT["main.tscn"]
    exported = set().union(*(variables_of(each) for each in scripts().values()))
    sections = re.findall(
        r'^\[(?:node|sub_resource) .*?type="(\w+)".*?\]\n(.*?)(?=^\[|\Z)', text, re.S | re.M
    )
    assert len(sections) == 6 + 15
    for kind, rows in sections:
        assert list(chain(api[version], kind)), kind
        there = members(api[version], kind, "properties").keys() | {"script"}
        has_script = "script = " in rows
        for row in re.findall(r"^(\w+) = ", rows, re.MULTILINE):
            assert row in there or (has_script and row in exported), f"{kind}: {row}"


def test_files_name_each_other(godot4):
    """Every file that a scene or script loads exists after the steps of docs/godot4.md."""
    there = {*PROJECT, "elephant.glb", "demo.softworld"}
    extension = "addons/taichi_soft/taichi_soft.gdextension"
    for path in PROJECT.keys() - {extension}:
        for target in re.findall(r'"res://([^"]+)"', PROJECT[path]):
            assert target in there, f"{path}: {target}"
    text = PROJECT[extension]
    shipped = set(re.findall(r'"res://addons/taichi_soft/bin/([^"]+)"', text))
    assert shipped == {path.name for path in (godot4 / "bin").iterdir()} - {"fake_host"}
    assert 'entry_symbol = "taichi_soft_godot_init"' in text


def test_nothing_for_godot_3_is_in_the_project():
    """The project for Godot 3, which test_godot.py runs, has nothing for Godot 4."""
    assert [path for path, text in PROJECT.items() if "Godot 3" in text] == []
    assert [path for path, text in files_of(3).items() if re.search(r"\w3D\b|Godot 4|@export", text)] == []
