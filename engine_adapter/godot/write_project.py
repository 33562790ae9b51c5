"""Write the demo as a project for Godot 3 or 4: `python write_project.py 3 FOLDER`.

The folder `demo` contains the nodes and the demo for Godot 4. `demo3` and `demo4` contain files for one
version only. For Godot 3, the tables below replace expressions. If this is not sufficient, a line is followed
by comments that begin with `# Godot 3: `. The text of these comments replaces the line.
"""

import re
import sys
from collections.abc import Callable
from pathlib import Path

Pairs = list[tuple[str, str | Callable[[re.Match[str]], str]]]

HERE = Path(__file__).resolve().parent
PICTURE = HERE.parents[1] / "assets" / "elephant.glb"
KINDS = (".gd", ".tscn", ".godot", ".gdns", ".gdnlib", ".gdextension", ".py")
"""Suffixes of the files that belong to a project. Godot's editor adds files with other suffixes."""

MARK = "# Godot 3: "

NAMES = {
    "AnimatableBody3D": "KinematicBody",
    "BoxMesh": "CubeMesh",
    "JSON.parse_string": "parse_json",
    "MOUSE_BUTTON_LEFT": "BUTTON_LEFT",
    "Node3D": "Spatial",
    "PackedInt32Array": "PoolIntArray",
    "RefCounted": "Reference",
    "StandardMaterial3D": "SpatialMaterial",
    "WorldBoundaryShape3D": "PlaneShape",
    "absf": "abs",
    "keycode": "scancode",
    "maxf": "max",
    "process_physics_priority": "process_priority",
    "reverse": "invert",
}
"""Names in Godot 3, by names in Godot 4."""

WORDS: Pairs = [
    *((rf"\b{re.escape(of_4)}\b", of_3) for of_4, of_3 in NAMES.items()),
    (r"\b([A-Z]\w+)3D(s?)\b", r"\1\2"),
    (r"\bPacked(\w+Array)\b", r"Pool\1"),
    (r"(?<!_path)\.is_empty\(\)", ".empty()"),  # a NodePath has `is_empty` in both versions
]
"""Pairs of a regular expression and its replacement, for scripts and scenes."""

GRAMMAR: Pairs = [
    (r"^## ", "# "),
    (r"^@export_group.*\n", ""),
    (r"^@export_dir ", "export(String, DIR) "),
    (r"^@export_range\((.*)\) ", lambda m: f"export({'float' if '.' in m[1] else 'int'}, {m[1]}) "),
    (r"^@(export|onready) ", r"\1 "),
    (r":\n    set = (\w+)", r" setget \1"),
    (r"^signal .*", lambda m: re.sub(r": \w+", "", m[0])),
    (r": Variant\b", ""),
    (r": Kind\b", ": int"),
    (r" -> Array\[\w+\]", " -> Array"),
    (r": Array\[\w+\] =", " :="),
    (r"\b(\w+)\.emit\(\)", r'emit_signal("\1")'),
    (r"\b(\w+)\.emit\(", r'emit_signal("\1", '),
    (r"\.(\w+)\.connect\((\w+)\)", r'.connect("\1", self, "\2")'),
    # Godot knows the class names of scripts only if the project file lists them.
    (r"(:|->) SoftWorld\b", r"\1 Node"),
    (r" as SoftWorld\b", ""),
    (r"\bSoftWorld\.(?=[A-Z])", "_world."),
]
"""Pairs of a regular expression and its replacement, for scripts."""

SCENE: Pairs = [
    (r"format=3", "format=2"),
    (r'id="(\d)"', r"id=\1"),
    (r'Resource\("(\d)"\)', r"Resource( \1 )"),
    (r"^sync_to_physics = .*\n", ""),
    (
        r'(type="BoxShape" id=\d\]\n)size = Vector3\((.*)\)',
        lambda m: f"{m[1]}extents = Vector3( {', '.join(f'{float(x) / 2:g}' for x in m[2].split(','))} )",
    ),
]
"""Pairs of a regular expression and its replacement, for scenes."""


def main() -> None:
    """Write a project, and replace the files of an earlier one."""
    if len(sys.argv) != 3 or sys.argv[1] not in ("3", "4"):
        sys.exit("usage: python write_project.py 3|4 FOLDER")
    folder = Path(sys.argv[2])
    for name, text in files_of(int(sys.argv[1])).items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8", newline="\n")
    (folder / PICTURE.name).write_bytes(PICTURE.read_bytes())


def files_of(version: int) -> dict[str, str]:
    """Return the text of each file of the project for a version of Godot, by path."""
    found = {}
    for source in (HERE / "demo", HERE / f"demo{version}"):
        for path in sorted(source.rglob("*")):
            if path.suffix in KINDS:
                text = path.read_text(encoding="utf-8")
                is_shared = source.name == "demo" and path.suffix in (".gd", ".tscn")
                found[path.relative_to(source).as_posix()] = translated(text, version) if is_shared else text
    return found


def translated(text: str, version: int) -> str:
    """Translate a script or scene from Godot 4 to `version`."""
    rows: list[str] = []
    is_replaced = False
    for row in text.splitlines():
        start, mark, other = row.partition(MARK)
        if mark and version == 3:
            if not is_replaced:
                rows.pop()
            rows.append(start + other)
        elif not mark:
            rows.append(row if version == 4 else _replaced(row, WORDS))
        is_replaced = bool(mark)
    found = "\n".join(rows) + "\n"
    if version == 4:
        return found
    return _replaced(found, SCENE if found.startswith("[gd_scene") else GRAMMAR)


def _replaced(text: str, pairs: Pairs) -> str:
    for pattern, new in pairs:
        text = re.sub(pattern, new, text, flags=re.MULTILINE)
    return text


if __name__ == "__main__":
    main()
