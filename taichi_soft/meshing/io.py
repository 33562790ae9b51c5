"""Read and write meshes; the suffix of the path selects the format.

    .npz          format of this package: compressed arrays `vertices` and `tets`
    .node, .ele   TetGen, a pair of files; the path can name either file
    .msh          Gmsh 1, 2, 4.0 and 4.1, text or binary (written as 4.1 text)
    .vtk, .vtu    VTK unstructured grids (.vtk written as text)
    .mesh         Medit, text

Gmsh, VTK and Medit files need the extra `taichi-soft[io]`. A surface (.obj, .stl and the like) has no
tetrahedra; `SoftBodyAsset.from_surface` makes a body from it.
"""

from __future__ import annotations

import contextlib
import os
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from taichi_soft.core.checks import as_path
from taichi_soft.core.errors import MeshError
from taichi_soft.meshing.advice import fill_hint, with_install_hint
from taichi_soft.meshing.interchange import FORMATS, read_interchange, write_interchange
from taichi_soft.meshing.tet_mesh import TetMesh
from taichi_soft.meshing.tetgen import read_tetgen, write_elements, write_nodes

SUFFIXES = (".npz", ".node", ".ele", *FORMATS)
SURFACES = (".stl", ".obj", ".ply", ".off", ".glb", ".gltf")
"""Formats that contain only triangles; `SoftBodyAsset.from_surface` reads them."""


def load_mesh(path: str | os.PathLike[str], *, fix_orientation: bool = True) -> TetMesh:
    """Read a tetrahedral mesh.

    Vertices that no tetrahedron uses (such as the construction points in Gmsh files) are dropped. The other
    vertices are renumbered in their order. All blocks of tetrahedra become one mesh. Tetrahedra with more
    than four nodes are reduced to their corners. Cells of other kinds are skipped. A SkippedCellsWarning
    counts the skipped cells that are not points, edges or faces of the body.

    Args:
        path: file whose suffix is one of .npz, .node, .ele, .msh, .vtk, .vtu, .mesh. Coordinates are metres.
        fix_orientation: reverse tetrahedra of negative volume. True by default, unlike in `TetMesh`, because
            programs differ in orientation. Overlapping neighbours are rejected in either case.
    Raises: MeshError if the file is missing, has another format, is cut short, has no tetrahedra or is not a
        valid mesh (see `TetMesh`), or if meshio is needed and missing; OptionError if `path` does not name a
        file. The message of a MeshError is one line that starts with the file's name. For a surface, the
        message says how to fill it.
    """
    source = as_path(path)
    suffix = source.suffix.lower()
    if suffix in SURFACES:
        raise MeshError(f"{source.name}: a surface, which has no tetrahedra: {fill_hint(repr(source.name))}")
    converter = with_install_hint(f"`meshio convert {source.name} {source.stem}.vtu`", "meshio")
    _require_format(source, f"; {converter} converts many others")
    read = _read_npz if suffix == ".npz" else read_interchange if suffix in FORMATS else read_tetgen
    try:
        reject_placeholder(source)
        vertices, tets = read(source)
    except OSError as error:
        raise MeshError(f"{_file_name(error, source)}: cannot be read ({error.strerror or error})") from None
    try:
        return TetMesh(*_without_unused(vertices, tets), fix_orientation=fix_orientation)
    except MeshError as error:
        raise MeshError(f"{source.name}: {error}") from None


def save_mesh(mesh: TetMesh, path: str | os.PathLike[str]) -> None:
    """Write a tetrahedral mesh, with every digit, in the format that the suffix of `path` selects.

    The write is atomic: an existing file stays until the new file is complete. If `path` names one of
    TetGen's two files, both files are written.
    Args:
        mesh: tetrahedra.
        path: path of the file, with a suffix that `load_mesh` reads.
    Raises: MeshError for an unknown suffix, a mesh that is not a TetMesh, a path that cannot be written to,
        or if meshio is needed and missing; OptionError if `path` does not name a file.
    Example:
        save_mesh(box(), "crate.npz")
        crate = load_mesh("crate.npz")
    """
    if not isinstance(mesh, TetMesh):
        raise MeshError(f"save_mesh got a {type(mesh).__name__}: only a TetMesh has a file format")
    target = as_path(path)
    _require_format(target)
    suffix = target.suffix.lower()
    writers: dict[Path, Callable[[Path], None]]
    if suffix == ".npz":
        writers = {target: lambda temporary: _write_npz(mesh, temporary)}
    elif suffix in FORMATS:
        writers = {target: lambda temporary: write_interchange(mesh, temporary, suffix)}
    else:
        writers = {
            target.with_suffix(".node"): lambda temporary: write_nodes(mesh, temporary),
            target.with_suffix(".ele"): lambda temporary: write_elements(mesh, temporary),
        }
    temporaries = {final: final.with_name(f".{final.name}.{os.getpid()}.tmp") for final in writers}
    try:
        for final, write in writers.items():
            if final.is_dir():
                raise MeshError(f"{final.name}: cannot be written (a folder has this name)")
            write(temporaries[final])
        for final, temporary in temporaries.items():
            os.replace(temporary, final)
    except OSError as error:
        raise MeshError(f"{target.name}: cannot be written ({error.strerror or error})") from None
    except MeshError as error:
        message = str(error)
        raise MeshError(message if message.startswith(target.stem) else f"{target.name}: {message}") from None
    finally:
        for temporary in temporaries.values():
            with contextlib.suppress(OSError):  # for example if the name is too long
                temporary.unlink(missing_ok=True)


def _require_format(path: Path, hint: str = "") -> None:
    if path.suffix.lower() not in SUFFIXES:
        raise MeshError(f"{path.name}: unknown mesh format {path.suffix!r}: use {', '.join(SUFFIXES)}{hint}")


def reject_placeholder(source: Path) -> None:
    """Check that a file is not a Git LFS pointer or a saved web page. Raises: MeshError if it is."""
    pair = source.suffix.lower() in (".node", ".ele")
    for path in (source.with_suffix(".node"), source.with_suffix(".ele")) if pair else (source,):
        with path.open("rb") as file:
            start = file.read(200).lstrip().lower()
        if start.startswith(b"version https://git-lfs.github.com/spec/"):
            raise MeshError(
                f"{path.name}: a Git LFS pointer, not the file itself: run `git lfs pull` in its repository "
                "(with the program from https://git-lfs.com), or download the file from its web page"
            )
        if start.startswith((b"<!doctype html", b"<html")):
            raise MeshError(f"{path.name}: a web page, not the file itself: download the raw file")


def _file_name(error: OSError, source: Path) -> str:
    """Return the name of the file that caused an error. For TetGen, this is one file of the pair."""
    return Path(os.fsdecode(error.filename)).name if error.filename else source.name


def _read_npz(path: Path) -> tuple[Any, Any]:
    if not zipfile.is_zipfile(path):
        raise MeshError(
            f"{path.name}: not a .npz file, or cut short: numpy.savez and save_mesh write such files"
        )
    try:
        with np.load(path, allow_pickle=False) as contents:
            names = sorted(contents.files)
            has_both = {"vertices", "tets"} <= set(names)
            arrays = (contents["vertices"], contents["tets"]) if has_both else None
    except OSError:
        raise
    # Damaged contents, objects that are not arrays and Python objects each raise a different exception.
    except Exception as error:
        reason = " ".join(str(error).split())[:200]
        raise MeshError(f"{path.name}: not a mesh file, or damaged ({reason})") from None
    if arrays is None:
        found = ", ".join(repr(name) for name in names[:10]) + (", ..." if len(names) > 10 else "")
        raise MeshError(
            f"{path.name}: needs arrays 'vertices' (n, 3) and 'tets' (m, 4), but the file has "
            f"{found or 'none'}: pass its arrays to TetMesh(vertices, tets) and write that by save_mesh"
        )
    if any(array.ndim != 2 for array in arrays):
        shapes = " and ".join(str(array.shape) for array in arrays)
        raise MeshError(f"{path.name}: vertices and tets must be tables (n, 3) and (m, 4), got {shapes}")
    return arrays


def _write_npz(mesh: TetMesh, path: Path) -> None:
    with path.open("wb") as file:  # numpy would append its own suffix to a path
        np.savez_compressed(file, vertices=mesh.vertices, tets=mesh.tets)


def _without_unused(vertices: Any, tets: Any) -> tuple[Any, Any]:
    """Drop vertices that no tetrahedron uses. Invalid indices stay, because `TetMesh` reports them."""
    if tets.dtype.kind not in "iu" or tets.size == 0 or tets.min() < 0 or tets.max() >= len(vertices):
        return vertices, tets
    used, inverse = np.unique(tets, return_inverse=True)
    return vertices[used], inverse.reshape(tets.shape)
