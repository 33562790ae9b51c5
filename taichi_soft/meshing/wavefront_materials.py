"""Material libraries (.mtl) of .obj files: colours and textures."""

from __future__ import annotations

from pathlib import Path

from taichi_soft.core.errors import MeshError
from taichi_soft.meshing.text import as_ascii, decoded, is_number
from taichi_soft.meshing.visuals import Look, find_referenced_file, read_image

MAX_ARGUMENTS = {b"-mm": 2, b"-o": 3, b"-s": 3, b"-t": 3}
"""Largest number of arguments of each option of a texture. Options that are not listed have one argument."""


def read_materials(path: Path, libraries: list[bytes], used: set[str]) -> tuple[dict[str, Look], list[str]]:
    """Read the materials that a .obj file uses.

    Args:
        path: path of the .obj file.
        libraries: arguments of the file's `mtllib` statements.
        used: names of the materials that the file uses.
    Returns: materials by name, and messages about missing materials and textures.
    """
    looks: dict[str, Look] = {}
    notes: list[str] = []
    images: dict[Path, object] = {}
    for library in dict.fromkeys(libraries):
        found = find_referenced_file(path, decoded(library))
        files = [found] if found else [find_referenced_file(path, decoded(name)) for name in library.split()]
        if not any(files):
            notes.append(f"its materials are not read: there is no file {decoded(library)!r} beside it")
        for file in filter(None, files):
            for name, (color, texture) in _materials(file.read_bytes()).items():
                if name in used and name not in looks:
                    image = _texture_image(path, file, texture, images, notes) if texture else None
                    looks[name] = Look(name, color, image)
    missing = sorted(used - set(looks))
    if missing and looks:
        names = ", ".join(missing[:5]) + (", ..." if len(missing) > 5 else "")
        notes.append(f"its libraries have no material {names}")
    return looks, notes


def _texture_image(
    path: Path, library: Path, texture: bytes, images: dict[Path, object], notes: list[str]
) -> object:
    name = decoded(texture)
    file = find_referenced_file(path, name, library.parent)
    if file is None:
        notes.append(f"the texture {name} is not read: there is no such file beside it")
        return None
    if file not in images:
        images[file] = None
        try:
            images[file] = read_image(name, file.read_bytes())
        except (MeshError, OSError) as error:
            notes.append(str(error))
    return images[file]


def _materials(data: bytes) -> dict[str, tuple[tuple[float, float, float, float] | None, bytes]]:
    """Return for each material, by name, the colour or None, and the name of the texture file or b""."""
    found: dict[str, dict[bytes, list[bytes]]] = {}
    current: dict[bytes, list[bytes]] = {}
    for line in as_ascii(data).split(b"\n"):
        words = line.split()
        if len(words) > 1:
            head = words[0].lower()
            if head == b"newmtl":
                current = found.setdefault(decoded(b" ".join(words[1:])), {})
            elif head == b"map_kd":
                current[head] = [_file(line)]
            else:
                current[head] = words[1:]
    return {name: (_color(values), values.get(b"map_kd", [b""])[0]) for name, values in found.items()}


def _color(values: dict[bytes, list[bytes]]) -> tuple[float, float, float, float] | None:
    try:
        rows = [float(word) for word in values[b"kd"][:3]]
        opacity = 1.0
        if b"d" in values:
            opacity = float(values[b"d"][-1])
        elif b"tr" in values:
            opacity = 1.0 - float(values[b"tr"][-1])
    except (KeyError, ValueError):  # no colour, or a colour defined by a spectrum
        return None
    red, green, blue = (rows * 3)[:3] if len(rows) == 1 else (rows + rows[-1:] * 2)[:3]
    clipped = [min(max(part, 0.0), 1.0) for part in (red, green, blue, opacity)]
    return clipped[0], clipped[1], clipped[2], clipped[3]


def _file(line: bytes) -> bytes:
    """Return the file name after the options of a texture. The name can contain spaces."""
    rest = line.split(None, 1)[1].strip()
    while rest.startswith(b"-") and b" " in rest:
        option, rest = rest.split(None, 1)
        for _ in range(MAX_ARGUMENTS.get(option.lower(), 1)):
            word, _, remainder = rest.partition(b" ")
            if option.lower() in (b"-o", b"-s", b"-t") and not is_number(word):
                break
            rest = remainder.lstrip()
    return rest
