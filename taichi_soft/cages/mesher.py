"""Tetrahedra by programs that others wrote, each in a process of its own.

They may crash or never end. Then there is an error, and nothing of them is left.
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
from taichi_soft.cages.welding import welded
from taichi_soft.core.errors import MeshError
from taichi_soft.core.extras import require_extra
from taichi_soft.meshing import TetMesh
from taichi_soft.meshing.arrays import FloatArray

Ints = NDArray[np.int64]
Made = dict[str, NDArray[np.generic]]

TAKES = {
    "tetgen": "closed surfaces that do not cross themselves",
    "ftetwild": "surfaces that enclose something",
}
"""By method: what it makes tetrahedra of."""

TIME_LIMIT = 120.0
"""[s]."""

GRACE = 3.0
"""Beyond the time limit, after which a process ends by itself that nobody ends [s]."""

INSIDE = 0.5
"""Winding number from which on a region is solid."""


def mesher_mesh(
    method: str, vertices: FloatArray, triangles: Ints, cell_size: float, time_limit: float = TIME_LIMIT
) -> TetMesh:
    """Tetrahedra whose outer faces follow a surface, every one solid.

    Args:
        method: one of `TAKES`.
        vertices: of the surface, (n, 3) [m].
        triangles: (m, 3).
        cell_size: length that edges should have [m].
        time_limit: after which the process is ended [s].
    Raises: MissingExtraError without the method's package; MeshError where it makes nothing of the surface,
        crashes or takes too long, with the method's own words.
    """
    require_extra(method, f"method {method!r} needs")
    points, corners = welded(vertices, triangles)
    if len(corners) == 0:
        raise MeshError("the surface has no area: it encloses nothing")
    # About 1 long and near 0: lengths that the programs take for equal are no part of the task.
    low, longest = points.min(axis=0), float(np.ptp(points, axis=0).max())
    points = (points - low) / longest
    made = _made(method, points, corners, cell_size / longest, time_limit)
    try:
        tets, regions = made["tets"], made["regions"].reshape(-1)
        tets = tets[_is_solid(made["vertices"], tets, regions, points[corners])]
        if len(tets) == 0:
            raise MeshError("there is nothing within the surface")
        used, numbers = np.unique(tets, return_inverse=True)
        at = made["vertices"][used]
        return TetMesh(low + longest * at, numbers.reshape(-1, 4), fix_orientation=True)
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise _failure(method, f"it made no sound tetrahedra ({_line(str(error))})") from None


def _made(method: str, vertices: FloatArray, triangles: Ints, cell_size: float, time_limit: float) -> Made:
    """What the method's process writes."""
    if not sys.executable or getattr(sys, "frozen", False):
        raise _failure(
            method,
            "it runs in a Python of its own, and a frozen program has none: make the mesh beforehand, "
            "and ship it (save_mesh)",
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
            with open(folder / "said.txt", "wb") as said:
                done = subprocess.run(
                    [sys.executable, "-c", code, *arguments],
                    cwd=folder,
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=said,
                    timeout=time_limit,
                    check=False,
                )
            if done.returncode:
                last = _line((folder / "said.txt").read_text(encoding="utf-8", errors="replace"))
                raise _failure(method, _ending(done.returncode) + (f" and said {last!r}" if last else ""))
            with np.load(folder / "tetrahedra.npz") as file:
                return {key: file[key] for key in file.files}
    except subprocess.TimeoutExpired:
        raise _failure(
            method,
            f"it took more than {time_limit:g} s and was ended: take larger cells, a coarser surface or a "
            "longer time_limit",
        ) from None
    except MeshError:
        raise
    except (OSError, EOFError, ValueError, zipfile.BadZipFile) as error:
        raise _failure(method, f"its result cannot be read ({_line(str(error))})") from None


def _failure(method: str, what: str) -> MeshError:
    return MeshError(
        f"method {method!r} made nothing of the surface: {what}. It takes {TAKES[method]}; "
        "method='lattice' takes all that enclose something"
    )


def _ending(code: int) -> str:
    """How a process ended, in words."""
    if code > 0:
        return f"its process ended with {code}"
    try:
        return f"its process ended by {signal.Signals(-code).name}"
    except ValueError:
        return f"its process ended by signal {-code}"


def _line(text: str) -> str:
    """The last line of what was said, in a length that fits into a message."""
    lines = [line for line in text.splitlines() if line.strip()]
    return lines[-1].strip()[:200] if lines else ""


def _is_solid(
    vertices: NDArray[np.generic],
    tets: NDArray[np.generic],
    regions: NDArray[np.generic],
    corners: FloatArray,
) -> NDArray[np.bool_]:
    """Which tetrahedra (m, 4) lie in regions (m,) that triangles (k, 3, 3) wind round; cavities do not."""
    numbers, region = np.unique(regions, return_inverse=True)
    if len(numbers) < 2:
        return np.ones(len(tets), dtype=np.bool_)
    x = np.asarray(vertices, dtype=np.float64)[tets]
    volumes = np.abs(np.linalg.det(x[:, 1:] - x[:, :1]))
    solid = np.zeros(len(numbers), dtype=np.bool_)
    for number in range(len(numbers)):
        mine = np.flatnonzero(region == number)
        middle = x[mine[volumes[mine].argmax()]].mean(axis=0)
        solid[number] = abs(winding_number(middle, corners)) > INSIDE
    return solid[region]


def winding_number(point: FloatArray, corners: FloatArray) -> float:
    """How often triangles (m, 3, 3) wind round a point, as their solid angles tell.

    Van Oosterom and Strackee, "The solid angle of a plane triangle" (1983), eq. 8.
    """
    a, b, c = np.moveaxis(corners - point, 1, 0)
    lengths = [np.linalg.norm(side, axis=1) for side in (a, b, c)]

    def dot(one: FloatArray, other: FloatArray) -> FloatArray:
        return np.asarray(np.einsum("ij,ij->i", one, other))

    down = lengths[0] * lengths[1] * lengths[2]
    down = down + dot(a, b) * lengths[2] + dot(b, c) * lengths[0] + dot(c, a) * lengths[1]
    return float(2.0 * np.arctan2(dot(a, np.cross(b, c)), down).sum() / (4.0 * np.pi))
