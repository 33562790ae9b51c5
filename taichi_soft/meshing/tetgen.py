"""TetGen's mesh files: points in a `.node` file and tetrahedra in an `.ele` file."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import MeshError
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.tet_mesh import TetMesh


def read_tetgen(path: Path) -> tuple[FloatArray, NDArray[np.int64]]:
    """Read the points, (n, 3), and the tetrahedra, (m, 4), as indices of points, counted from 0.

    The number of the first point decides whether the file counts from 0 or 1. Comments (#), attributes and
    boundary markers are skipped. Second-order tetrahedra (10 nodes) are reduced to their four corners.
    Args: path: path of either file of the pair.
    Raises: MeshError if a file is cut short or invalid; OSError if a file is missing.
    """
    node_path, element_path = path.with_suffix(".node"), path.with_suffix(".ele")
    header, table = _read_table(node_path, "points")
    if len(header) > 1 and header[1] != 3:
        raise MeshError(f"{node_path.name}: points have {header[1]} coordinates, 3 are needed")
    if table.shape[1] < 4:
        raise MeshError(f"{node_path.name}: a point has {table.shape[1]} columns, number x y z are needed")
    first = table[0, 0]
    if first not in (0, 1) or (np.diff(table[:, 0]) != 1).any():
        raise MeshError(f"{node_path.name}: points must be numbered consecutively from 0 or 1")

    header, elements = _read_table(element_path, "tetrahedra")
    if len(header) < 2 or header[1] not in (4, 10) or elements.shape[1] < 5:
        raise MeshError(f"{element_path.name}: tetrahedra need 4 or 10 nodes each, the header is {header}")
    corners = elements[:, 1:5]
    if (corners != np.floor(corners)).any():
        raise MeshError(f"{element_path.name}: a vertex number is not an integer")
    return table[:, 1:4], (corners - first).astype(np.int64)


def write_nodes(mesh: TetMesh, path: Path) -> None:
    """Write the points, counted from 0, with every digit of their coordinates."""
    rows = (f"{i} {x!r} {y!r} {z!r}" for i, (x, y, z) in enumerate(mesh.vertices.tolist()))
    _write_lines(path, f"{len(mesh.vertices)} 3 0 0", rows)


def write_elements(mesh: TetMesh, path: Path) -> None:
    """Write the tetrahedra, counted from 0."""
    rows = (f"{i} {a} {b} {c} {d}" for i, (a, b, c, d) in enumerate(mesh.tets.tolist()))
    _write_lines(path, f"{len(mesh.tets)} 4 0", rows)


def _write_lines(path: Path, header: str, rows: Iterable[str]) -> None:
    path.write_text("\n".join(["# taichi-soft", header, *rows]) + "\n", encoding="ascii")


def _read_table(path: Path, element: str) -> tuple[list[int], FloatArray]:
    """Return the integers of the header line, and the rows below it as an array."""
    try:
        text = re.sub(r"#[^\n]*", "", path.read_text(encoding="utf-8"))
    except UnicodeDecodeError:
        raise MeshError(f"{path.name}: not a text file, so not a {path.suffix} mesh") from None
    if text and not text.endswith("\n"):
        raise MeshError(f"{path.name}: the last line has no end: the file is cut short (or add a newline)")
    lines = [line for line in text.splitlines() if line.strip()]
    try:
        header = [int(word) for word in lines[0].split()] if lines else []
        numbers = np.array(" ".join(lines[1:]).split(), dtype=np.float64)
    except ValueError as error:
        raise MeshError(f"{path.name}: not a TetGen file ({error})") from None
    if not header or header[0] < 1:
        raise MeshError(f"{path.name}: contains no {element}")
    width = len(lines[1].split()) if len(lines) > 1 else 0
    if width == 0 or len(numbers) != header[0] * width:
        raise MeshError(
            f"{path.name}: declares {header[0]} {element} and has {len(numbers) / max(width, 1):g}: "
            "the file is cut short or damaged"
        )
    return header, numbers.reshape(header[0], width)
