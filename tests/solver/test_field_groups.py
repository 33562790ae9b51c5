"""Docstrings of kernel files list the groups of fields that they use; only the owner of a group writes it.

The groups are those of `State`. The fields of particles, bodies and elements in `BodyFields` have no owner.
"""

import ast
import re
from pathlib import Path

import pytest

import taichi_soft
from taichi_soft.solver.state import State

pytestmark = pytest.mark.numpy

ROOT = Path(taichi_soft.__file__).parent
GROUPS = State.GROUPS
ALIASES = {"touching": "hull"}
"""Other names of groups in a state."""

FILLS_SLOTS = {"solver/kernels/spawn.py", "fracture/kernels/topology.py"}
"""Kernels that place a body in a slot. They write its initial values in every group."""


def kernel_files():
    files = [path for path in sorted(ROOT.rglob("*.py")) if "@ti." in path.read_text()]
    return {path.relative_to(ROOT).as_posix(): ast.parse(path.read_text()) for path in files}


FILES = kernel_files()


def path_of(node):
    """Names in a path such as `a.b[i].c`, without indices: a, b, c."""
    names = []
    while isinstance(node, (ast.Attribute, ast.Subscript)):
        if isinstance(node, ast.Attribute):
            names.append(node.attr)
        node = node.value
    return [node.id, *reversed(names)] if isinstance(node, ast.Name) else []


def group_of(names, known):
    """Group of fields to which a path belongs, or None."""
    if names and names[0] in known:
        names = ["state", known[names[0]], *names[1:]]
    if len(names) < 2 or names[0] != "state":
        return None
    group = ALIASES.get(names[1], names[1])
    return group if group in GROUPS else None


def touched(tree):
    """Groups that the functions of a file only read, and groups that they write."""
    read, written = set(), set()
    for function in ast.walk(tree):
        if not isinstance(function, ast.FunctionDef):
            continue
        arguments = {each.arg for each in function.args.args}
        known = {name: name for name in GROUPS if name in arguments}
        for node in ast.walk(function):
            if isinstance(node, ast.Assign):
                for target, value in pairs(node.targets[0], node.value):
                    group = group_of(path_of(value), {}) if isinstance(value, ast.Attribute) else None
                    if group and len(path_of(value)) == 2 and isinstance(target, ast.Name):
                        known[target.id] = group
        for node in ast.walk(function):
            if isinstance(node, (ast.Attribute, ast.Name)):
                group = (
                    group_of(path_of(node), known) if isinstance(node, ast.Attribute) else known.get(node.id)
                )
                read |= {group} - {None}
            for target in targets(node):
                group = group_of(path_of(target), known)
                written |= {group} - {None}
    return read - written, written


def pairs(target, value):
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        return list(zip(target.elts, value.elts, strict=True))
    return [(target, value)]


def targets(node):
    """Indexed targets of a statement or an atomic operation."""
    if isinstance(node, ast.Call) and ast.unparse(node.func).startswith("ti.atomic"):
        return node.args[:1]
    found = node.targets if isinstance(node, ast.Assign) else []
    found = [node.target] if isinstance(node, ast.AugAssign) else found
    inner = [
        each for target in found for each in (target.elts if isinstance(target, ast.Tuple) else [target])
    ]
    return [each for each in inner if isinstance(each, ast.Subscript)]


def as_said(read, written):
    """Return the sentence that the docstring of a file must contain; "" if the file uses no groups."""
    parts = [f"reads {', '.join(sorted(read))}"] if read else []
    parts += [f"writes {', '.join(sorted(written))}"] if written else []
    return f"Groups of fields: {'; '.join(parts)}." if parts else ""


def test_there_is_something_to_check():
    assert len(FILES) > 60
    assert touched(FILES["contact/kernels/rebound.py"]) == (set(), {"colliders"})
    assert "islands" in touched(FILES["control/kernels/joints.py"])[0]


@pytest.mark.parametrize("name", FILES)
def test_a_file_of_kernels_says_which_groups_of_fields_it_reads_and_writes(name):
    docstring = " ".join((ast.get_docstring(FILES[name]) or "").split())
    said = re.search(r"Groups of fields: [^.]*\.", docstring)
    assert (said.group() if said else "") == as_said(*touched(FILES[name]))


@pytest.mark.parametrize("name", [name for name in FILES if name not in FILLS_SLOTS])
def test_only_the_owner_of_a_group_of_fields_writes_it(name):
    _, written = touched(FILES[name])
    assert {GROUPS[group].owner for group in written} <= {name.split("/")[0]}


def test_each_group_has_an_owner():
    assert len(GROUPS) > 5
    for kind in GROUPS.values():
        assert (ROOT / kind.owner).is_dir()
