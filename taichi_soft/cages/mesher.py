"""Run external meshers, each in its own process.

If a mesher crashes or exceeds the time limit, an error is raised and the mesher's files are removed.
"""

from __future__ import annotations

import inspect
import signal
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_soft.cages import mesher_process
from taichi_soft.core.errors import MeshError
from taichi_soft.core.extras import require_extra
from taichi_soft.meshing import TetMesh
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.welding import welded

Ints = NDArray[np.int64]
Arrays = dict[str, NDArray[np.generic]]

ACCEPTS = {
    "tetgen": "closed surfaces that do not cross themselves",
    "ftetwild": "surfaces that enclose something",
}
"""Description of the surfaces that each method accepts."""

TIME_LIMIT = 120.0
"""Default time limit of a mesher [s]."""

GRACE = 3.0
"""Time after the time limit at which a mesher's process ends itself, if it was not killed before [s]."""

INSIDE = 0.5
"""Winding number above which a region is solid."""


def mesher_mesh(
    method: str, vertices: FloatArray, triangles: Ints, cell_size: float, time_limit: float = TIME_LIMIT
) -> TetMesh:
    """Make solid tetrahedra whose outer faces follow a surface.

    Args:
        method: one of `ACCEPTS`.
        vertices: vertices of the surface, (n, 3) [m].
        triangles: (m, 3).
        cell_size: target length of the edges [m].
        time_limit: time after which the process is killed [s].
    Raises: MissingExtraError if the method's package is missing; MeshError, with the method's own message, if
        the method fails, crashes or exceeds the time limit.
    """
    require_extra(method, f"method {method!r} needs")
    points, corners = welded(vertices, triangles)
    if len(corners) == 0:
        raise MeshError("the surface has no area: it encloses nothing")
    # Scale the surface to size 1 near the origin, because the meshers have absolute tolerances.
    low, longest = points.min(axis=0), float(np.ptp(points, axis=0).max())
    points = (points - low) / longest
    arrays = _run_mesher(method, points, corners, cell_size / longest, time_limit)
    try:
        tets, regions = arrays["tets"], arrays["regions"].reshape(-1)
        tets = tets[_is_solid(arrays["vertices"], tets, regions, points[corners])]
        if len(tets) == 0:
            raise MeshError("there is nothing within the surface")
        used, numbers = np.unique(tets, return_inverse=True)
        positions = arrays["vertices"][used]
        return TetMesh(low + longest * positions, numbers.reshape(-1, 4), fix_orientation=True)
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise _failure(method, f"it made no valid tetrahedra ({_line(str(error))})") from None


def _run_mesher(
    method: str, vertices: FloatArray, triangles: Ints, cell_size: float, time_limit: float
) -> Arrays:
    """Run the process of a method and return the arrays that the process writes."""
    if not sys.executable or getattr(sys, "frozen", False):
        raise _failure(
            method,
            "it runs in a separate Python process, which a frozen program cannot start: make the mesh "
            "beforehand and ship it (save_mesh)",
        )
    code = inspect.getsource(mesher_process)
    arguments = [method, str(time_limit + GRACE), *sys.path]
    try:
        with tempfile.TemporaryDirectory(prefix="taichi_soft_") as name:
            folder = Path(name)
            np.savez(
                folder / "surface.npz",
                vertices=vertices,
                triangles=triangles.astype(np.int32),
                cell_size=np.float64(cell_size),
            )
            with open(folder / "stderr.txt", "wb") as log:
                done = subprocess.run(
                    [sys.executable, "-c", code, *arguments],
                    cwd=folder,
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=log,
                    timeout=time_limit,
                    check=False,
                )
            if done.returncode:
                last = _line((folder / "stderr.txt").read_text(encoding="utf-8", errors="replace"))
                raise _failure(method, _ending(done.returncode) + (f": {last!r}" if last else ""))
            with np.load(folder / "tetrahedra.npz") as file:
                return {key: file[key] for key in file.files}
    except subprocess.TimeoutExpired:
        raise _failure(
            method,
            f"it took more than {time_limit:g} s and was killed: use larger cells, a coarser surface or a "
            "longer time_limit",
        ) from None
    except MeshError:
        raise
    except (OSError, EOFError, ValueError, zipfile.BadZipFile) as error:
        raise _failure(method, f"its result cannot be read ({_line(str(error))})") from None


def _failure(method: str, reason: str) -> MeshError:
    return MeshError(
        f"method {method!r} failed on the surface: {reason}. It accepts {ACCEPTS[method]}; method='lattice' "
        "accepts every surface that encloses something"
    )


def _ending(code: int) -> str:
    """Describe how a process ended, from its exit code. A negative code is a signal."""
    if code > 0:
        return f"its process ended with {code}"
    try:
        return f"its process ended by {signal.Signals(-code).name}"
    except ValueError:
        return f"its process ended by signal {-code}"


def _line(text: str) -> str:
    """Return the last non-empty line of `text`, cut to 200 characters."""
    lines = [line for line in text.splitlines() if line.strip()]
    return lines[-1].strip()[:200] if lines else ""


def _is_solid(
    vertices: NDArray[np.generic],
    tets: NDArray[np.generic],
    regions: NDArray[np.generic],
    corners: FloatArray,
) -> NDArray[np.bool_]:
    """True for tetrahedra in regions that triangles enclose, (m,). Cavities are not solid.

    Args:
        vertices: (n, 3).
        tets: (m, 4).
        regions: region of each tetrahedron, (m,).
        corners: corners of the triangles, (k, 3, 3).
    """
    numbers, region = np.unique(regions, return_inverse=True)
    if len(numbers) < 2:
        return np.ones(len(tets), dtype=np.bool_)
    x = np.asarray(vertices, dtype=np.float64)[tets]
    volumes = np.abs(np.linalg.det(x[:, 1:] - x[:, :1]))
    solid = np.zeros(len(numbers), dtype=np.bool_)
    for number in range(len(numbers)):
        in_region = np.flatnonzero(region == number)
        middle = x[in_region[volumes[in_region].argmax()]].mean(axis=0)
        solid[number] = abs(winding_number(middle, corners)) > INSIDE
    return solid[region]


def winding_number(point: FloatArray, corners: FloatArray) -> float:
    """Return the winding number of triangles (m, 3, 3) around a point, computed from solid angles.

    Van Oosterom and Strackee, "The solid angle of a plane triangle" (1983), eq. 8.
    """
    a, b, c = np.moveaxis(corners - point, 1, 0)
    lengths = [np.linalg.norm(side, axis=1) for side in (a, b, c)]

    def dot(one: FloatArray, other: FloatArray) -> FloatArray:
        return np.asarray(np.einsum("ij,ij->i", one, other))

    denominator = lengths[0] * lengths[1] * lengths[2]
    denominator = denominator + dot(a, b) * lengths[2] + dot(b, c) * lengths[0] + dot(c, a) * lengths[1]
    return float(2.0 * np.arctan2(dot(a, np.cross(b, c)), denominator).sum() / (4.0 * np.pi))
