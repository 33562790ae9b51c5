"""Gmsh and VTK files, read and written by meshio, which is installed with `taichi-soft[io]`."""

from __future__ import annotations

import contextlib
import importlib
import io
import re
from pathlib import Path
from typing import Any

import numpy as np

from taichi_soft.errors import MeshError
from taichi_soft.meshing.tet_mesh import TetMesh

# meshio's module for each suffix, and how to make it write what older programs read too, with every digit
# (its text form of .vtu keeps twelve).
FORMATS: dict[str, tuple[str, dict[str, object]]] = {
    ".msh": ("gmsh", {"fmt_version": "4.1", "binary": False}),
    ".vtk": ("vtk", {"fmt_version": "4.2", "binary": False}),
    ".vtu": ("vtu", {"binary": True}),
}
# Four corners come first in tetrahedra of every order.
TETRAHEDRA = ("tetra", "tetra10", "tetra20", "tetra35", "tetra56")


def read_interchange(path: Path) -> tuple[Any, Any]:
    """Points (n, 3) and vertex indices (m, 4): all blocks of tetrahedra of the file, one after the other.

    Cells of other kinds are left out; of higher-order tetrahedra the four corners are taken.
    Raises: MeshError if meshio is missing or cannot read the file, or if it holds no tetrahedra.
    """
    name, _ = FORMATS[path.suffix.lower()]
    reader = _meshio_module(name)
    with path.open("rb") as file:  # a missing or locked file is the caller's OSError, before meshio words it
        _require_end(path, name, file.read())
    # The format's own reader: meshio.read() prints and ends the process when a file is bad.
    with _quiet(f"{path.name}: cannot be read as {name}"):
        contents = reader.read(str(path))
        blocks = [np.asarray(block.data)[:, :4] for block in contents.cells if block.type in TETRAHEDRA]
        kinds = sorted({str(block.type) for block in contents.cells})
        points = np.asarray(contents.points)
    if not blocks:
        raise MeshError(f"{path.name}: holds no tetrahedra, only {', '.join(kinds) or 'points'}")
    return points, np.concatenate(blocks)


def _require_end(path: Path, name: str, content: bytes) -> None:
    """Raises: MeshError where a file is cut short in a way that meshio reads as another mesh."""
    if name == "vtk" and b"ASCII" in content[:1000]:
        if not content.endswith(b"\n"):
            raise MeshError(f"{path.name}: the last line has no end: cut short? (or add a newline)")
        announced = re.search(rb"CELL_TYPES\s+(\d+)((?:\s+\d+)*)", content)
        if announced and len(announced[2].split()) < int(announced[1]):
            raise MeshError(f"{path.name}: fewer cell types than announced: the file is cut short")
    if name == "gmsh":
        opened = re.findall(rb"^\$(?!End)(\w+)", content, re.MULTILINE)
        closed = re.findall(rb"^\$End(\w+)\s", content + b"\n", re.MULTILINE)
        if set(opened) - set(closed):
            raise MeshError(f"{path.name}: section ${opened[-1].decode()} has no end: the file is cut short")


def write_interchange(mesh: TetMesh, path: Path, suffix: str) -> None:
    """Write in the format that `suffix` names. Raises: MeshError if meshio is missing or fails."""
    name, options = FORMATS[suffix]
    writer = _meshio_module(name)
    meshio = importlib.import_module("meshio")
    with _quiet(f"cannot be written as {name}"):
        writer.write(str(path), meshio.Mesh(mesh.vertices, [("tetra", mesh.tets)]), **options)


def _meshio_module(name: str) -> Any:
    try:
        return importlib.import_module(f"meshio.{name}")
    except ImportError:
        raise MeshError(
            f'{name} files need the package meshio: pip install "taichi-soft[io]", or use .npz or .node/.ele'
        ) from None


@contextlib.contextmanager
def _quiet(failure: str) -> Any:
    """Swallow what meshio prints and turn whatever it raises into one line that starts with `failure`."""
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        try:
            yield
        except OSError:
            raise
        # meshio's readers raise anything from IndexError to SystemExit on damaged files.
        except (Exception, SystemExit) as error:
            reason = " ".join(str(error).split())[:200] or type(error).__name__
            raise MeshError(f"{failure} ({reason})") from None
