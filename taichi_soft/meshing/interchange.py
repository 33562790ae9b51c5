"""Gmsh, VTK and Medit files, read and written by meshio, which is installed with `taichi-soft[io]`."""

from __future__ import annotations

import contextlib
import importlib
import io
import re
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import MeshError, SkippedCellsWarning
from taichi_soft.meshing import gmsh, medit
from taichi_soft.meshing.advice import filling
from taichi_soft.meshing.tet_mesh import TetMesh

# meshio's module for each suffix, and how to make it write what older programs read too, with every digit
# (its text form of .vtu keeps twelve).
FORMATS: dict[str, tuple[str, dict[str, object]]] = {
    ".msh": ("gmsh", {"fmt_version": "4.1", "binary": False}),
    ".vtk": ("vtk", {"fmt_version": "4.2", "binary": False}),
    ".vtu": ("vtu", {"binary": True}),
    ".mesh": ("medit", {}),
}
# What of a file meshio is given where it reads the whole only if it knows all of it.
SECTIONS: dict[str, Callable[[Path, bytes], bytes]] = {
    "gmsh": gmsh.mesh_sections,
    "medit": medit.mesh_sections,
}
# What meshio calls tetrahedra of every order begins so; their four corners come first.
TETRAHEDRA = ("tetra", "VTK_LAGRANGE_TETRAHEDRON")


def read_interchange(path: Path) -> tuple[Any, Any]:
    """Points (n, 3) and vertex indices (m, 4): all blocks of tetrahedra of the file, one after the other.

    Of higher-order tetrahedra the four corners are taken. Cells of other kinds that are no part of a
    tetrahedron are left out with a SkippedCellsWarning.
    Raises: MeshError if meshio is missing or cannot read the file, or if it holds no tetrahedra.
    """
    name, _ = FORMATS[path.suffix.lower()]
    reader = _meshio_module(name)
    content = path.read_bytes()  # a missing or locked file is the caller's OSError, before meshio words it
    announced = 0
    if name in SECTIONS:
        content = SECTIONS[name](path, content)
    else:
        announced = _announced_cells(path, name, content)
    # The format's own reader: meshio.read() ends the process when a file is bad.
    with tempfile.TemporaryDirectory() as folder, _quiet(f"{path.name}: cannot be read as {name}") as printed:
        source = path
        if name in SECTIONS:
            source = Path(folder) / path.name
            source.write_bytes(content)
        contents = reader.read(str(source))
        points, blocks = np.asarray(contents.points), contents.cells
        tets = [np.asarray(block.data)[:, :4] for block in blocks if block.type.startswith(TETRAHEDRA)]
        others = [block for block in blocks if not block.type.startswith(TETRAHEDRA)]
    if "not closed by" in printed.getvalue():  # what the section announces reaches beyond its end
        raise MeshError(
            f"{path.name}: a section is shorter than it announces: the file is cut short or damaged"
        )
    unknown = announced - sum(len(block) for block in blocks)
    if unknown > 0 and name == "vtk" and b"Version 5.1" not in content[:40]:
        raise MeshError(f"{path.name}: {unknown} cell types fewer than announced: the file is cut short")
    if not tets:
        held = _counted(((block.type, len(block)) for block in others), unknown)
        raise MeshError(
            f"{path.name}: holds no tetrahedra, only {held}{_way_out(path, points, others, unknown)}"
        )
    corners = np.concatenate(tets)
    skipped = _counted(((block.type, _rows_apart(block, corners)) for block in others), unknown)
    if skipped:
        warnings.warn(
            f"{path.name}: left out cells of other kinds ({skipped}) beside {len(corners)} tetrahedra. Where "
            "they belong to the body, divide them into tetrahedra first",
            SkippedCellsWarning,
            stacklevel=3,
        )
    return points, corners


def _announced_cells(path: Path, name: str, content: bytes) -> int:
    """How many cells a VTK file says that it holds. meshio skips some, and takes some that are cut short.

    Raises: MeshError where a file is cut short, or in pieces of which meshio reads the last.
    """
    if name == "vtu":
        pieces = re.findall(rb"<Piece\s[^>]*NumberOfCells\s*=\s*[\"'](\d+)", content)
        if len(pieces) > 1:
            raise MeshError(
                f"{path.name}: is in {len(pieces)} pieces with vertices of their own each: join them and "
                "save them as one (ParaView: the filters Merge Blocks and Clean to Grid)"
            )
        return sum(int(count) for count in pieces)
    head = content[:1000].split(b"\n")
    if head[0].lstrip().startswith((b"<?xml", b"<VTKFile")):
        raise MeshError(f"{path.name}: is an XML file of VTK: give it the suffix .vtu")
    if any(line.upper().split() == [b"DATASET", b"POLYDATA"] for line in head):
        raise MeshError(f"{path.name}: holds no tetrahedra, only POLYDATA, which is {_surface(path)}")
    if len(head) > 2 and head[2].strip().upper() == b"ASCII":
        if not content.endswith(b"\n"):
            raise MeshError(f"{path.name}: the last line has no end: cut short? (or add a newline)")
    announced = re.search(rb"^CELL_TYPES\s+(\d+)\s", content, re.MULTILINE | re.IGNORECASE)
    return int(announced[1]) if announced else 0


def _rows_apart(block: Any, tets: NDArray[Any]) -> int:
    """How many cells are more than points, edges and faces of the body, which programs write beside it."""
    if block.dim == 0:
        return 0
    if block.dim == 3:
        return len(block)
    return int((~np.isin(np.asarray(block.data)[:, : block.dim + 1], tets).all(axis=1)).sum())


def _counted(cells: Iterable[tuple[str, int]], unknown: int) -> str:
    counts: Counter[str] = Counter()
    for kind, count in (*cells, ("of kinds that meshio does not know", unknown)):
        counts[kind] += count
    return ", ".join(f"{count} {kind}" for kind, count in counts.items() if count > 0)


def _way_out(path: Path, points: NDArray[Any], blocks: list[Any], unknown: int) -> str:
    """What to do with a file that has no tetrahedra."""
    if any(block.dim == 3 for block in blocks) or unknown > 0:
        return ": divide them into tetrahedra in the program that made them"
    if not any(block.dim == 2 for block in blocks):
        return f"{'' if blocks else 'points'}: save what fills the body too"
    if len(points) == 0 or np.ptp(points, axis=0).min() == 0:
        return ", all in one plane: a body needs a thickness"
    return f", which is {_surface(path)}"


def _surface(path: Path) -> str:
    name = path.with_suffix(".stl").name
    return f"a surface: save it as {name}, then {filling(repr(name))}"


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
def _quiet(failure: str) -> Iterator[io.StringIO]:
    """Catch what meshio prints and turn whatever it raises into one line that starts with `failure`."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        try:
            yield printed
        except OSError:
            raise
        # meshio's readers raise anything from IndexError to SystemExit on damaged files.
        except (Exception, SystemExit) as error:
            raise MeshError(f"{failure} ({_reason(error)})") from None


def _reason(error: BaseException) -> str:
    text = " ".join(str(error).split())[:200]
    if isinstance(error, KeyError):  # its text is the key alone
        return f"meshio does not know {text}: if that is a kind of cell, save the tetrahedra only"
    if not text:
        return (
            f"meshio says {type(error).__name__}, and no more: it is damaged, or of a variety that it does "
            "not know. Save it again as text, or in another format"
        )
    return text
