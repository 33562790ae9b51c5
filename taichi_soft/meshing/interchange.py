"""Read and write Gmsh, VTK and Medit files through meshio (extra `taichi-soft[io]`)."""

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
from taichi_soft.meshing.advice import fill_hint
from taichi_soft.meshing.tet_mesh import TetMesh

# meshio's module for each suffix, and options for writing. With these options, files keep every digit and
# older programs can read them. (.vtu is binary because meshio's text form keeps only twelve digits.)
FORMATS: dict[str, tuple[str, dict[str, object]]] = {
    ".msh": ("gmsh", {"fmt_version": "4.1", "binary": False}),
    ".vtk": ("vtk", {"fmt_version": "4.2", "binary": False}),
    ".vtu": ("vtu", {"binary": True}),
    ".mesh": ("medit", {}),
}
# Functions that reduce a file to the sections that meshio needs, because meshio fails on unknown sections.
SECTIONS: dict[str, Callable[[Path, bytes], bytes]] = {
    "gmsh": gmsh.mesh_sections,
    "medit": medit.mesh_sections,
}
# meshio's names for tetrahedra of any order begin with one of these. The first four nodes are the corners.
TETRAHEDRA = ("tetra", "VTK_LAGRANGE_TETRAHEDRON")


def read_interchange(path: Path) -> tuple[Any, Any]:
    """Read a file with meshio. Returns: points (n, 3), and the tetrahedra of all blocks, (m, 4).

    Higher-order tetrahedra are reduced to their four corners. Cells of other kinds that are not part of a
    tetrahedron are skipped with a SkippedCellsWarning.
    Raises: MeshError if meshio is missing or cannot read the file, or if the file contains no tetrahedra.
    """
    name, _ = FORMATS[path.suffix.lower()]
    reader = _meshio_module(name)
    content = path.read_bytes()  # raises OSError for missing or locked files, which meshio would hide
    declared = 0
    if name in SECTIONS:
        content = SECTIONS[name](path, content)
    else:
        declared = _declared_cells(path, name, content)
    # Use the format's own reader, because meshio.read() ends the process on a bad file.
    with tempfile.TemporaryDirectory() as folder, _quiet(f"{path.name}: cannot be read as {name}") as printed:
        source = path
        if name in SECTIONS:
            source = Path(folder) / path.name
            source.write_bytes(content)
        contents = reader.read(str(source))
        points, blocks = np.asarray(contents.points), contents.cells
        tets = [np.asarray(block.data)[:, :4] for block in blocks if block.type.startswith(TETRAHEDRA)]
        others = [block for block in blocks if not block.type.startswith(TETRAHEDRA)]
    if "not closed by" in printed.getvalue():  # the section's count is too large
        raise MeshError(
            f"{path.name}: a section is shorter than its count says: the file is cut short or damaged"
        )
    unknown = declared - sum(len(block) for block in blocks)
    if unknown > 0 and name == "vtk" and b"Version 5.1" not in content[:40]:
        raise MeshError(f"{path.name}: {unknown} of {declared} cell types are missing: the file is cut short")
    if not tets:
        found = _counted(((block.type, len(block)) for block in others), unknown)
        raise MeshError(
            f"{path.name}: contains no tetrahedra, only {found}{_suggest_fix(path, points, others, unknown)}"
        )
    corners = np.concatenate(tets)
    skipped = _counted(((block.type, _count_separate(block, corners)) for block in others), unknown)
    if skipped:
        warnings.warn(
            f"{path.name}: skipped cells of other kinds ({skipped}) and read {len(corners)} tetrahedra. If "
            "they belong to the body, divide them into tetrahedra first",
            SkippedCellsWarning,
            stacklevel=3,
        )
    return points, corners


def _declared_cells(path: Path, name: str, content: bytes) -> int:
    """Return the number of cells that a VTK file declares.

    This number reveals skipped cells and truncated files.
    Raises: MeshError if the file is truncated or has several pieces. (meshio reads only the last piece.)
    """
    if name == "vtu":
        pieces = re.findall(rb"<Piece\s[^>]*NumberOfCells\s*=\s*[\"'](\d+)", content)
        if len(pieces) > 1:
            raise MeshError(
                f"{path.name}: has {len(pieces)} pieces, each with its own vertices: join them and save "
                "them as one (ParaView: the filters Merge Blocks and Clean to Grid)"
            )
        return sum(int(count) for count in pieces)
    head = content[:1000].split(b"\n")
    if head[0].lstrip().startswith((b"<?xml", b"<VTKFile")):
        raise MeshError(f"{path.name}: is a VTK file in XML: give it the suffix .vtu")
    if any(line.upper().split() == [b"DATASET", b"POLYDATA"] for line in head):
        raise MeshError(f"{path.name}: contains no tetrahedra, only POLYDATA, which is {_surface(path)}")
    if len(head) > 2 and head[2].strip().upper() == b"ASCII":
        if not content.endswith(b"\n"):
            raise MeshError(f"{path.name}: the last line has no end: cut short? If not, add a newline")
    declared = re.search(rb"^CELL_TYPES\s+(\d+)\s", content, re.MULTILINE | re.IGNORECASE)
    return int(declared[1]) if declared else 0


def _count_separate(block: Any, tets: NDArray[Any]) -> int:
    """Count the cells in `block` that are not points, edges or faces of `tets`."""
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


def _suggest_fix(path: Path, points: NDArray[Any], blocks: list[Any], unknown: int) -> str:
    """Return a hint on what to do with a file that has no tetrahedra."""
    if any(block.dim == 3 for block in blocks) or unknown > 0:
        return ": divide them into tetrahedra in the program that made them"
    if not any(block.dim == 2 for block in blocks):
        return f"{'' if blocks else 'points'}: save the cells that fill the body too"
    if len(points) == 0 or np.ptp(points, axis=0).min() == 0:
        return ", all in one plane: a body needs a thickness"
    return f", which is {_surface(path)}"


def _surface(path: Path) -> str:
    name = path.with_suffix(".stl").name
    return f"a surface: save it as {name}, then {fill_hint(repr(name))}"


def write_interchange(mesh: TetMesh, path: Path, suffix: str) -> None:
    """Write a mesh in the format of `suffix`. Raises: MeshError if meshio is missing or fails."""
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
    """Capture meshio's output and turn its exceptions into a MeshError that starts with `failure`."""
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
    if isinstance(error, KeyError):  # the text of a KeyError is only the missing key
        return f"meshio does not know {text}: if that is a kind of cell, save only the tetrahedra"
    if not text:
        return (
            f"meshio raised {type(error).__name__} without a message: the file is damaged, or of an unknown "
            "variant. Save it again as text, or in another format"
        )
    return text
