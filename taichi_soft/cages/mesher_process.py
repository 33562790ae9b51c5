"""Program of a mesher's process. It reads surface.npz and writes tetrahedra.npz in the working folder.

The interpreter receives this module as text. The module imports nothing from this package, because such an
import would start Taichi.

Arguments: the method, the time after which the process ends in any case [s], and `sys.path`.
"""

from __future__ import annotations

import faulthandler
import math
import sys
from types import ModuleType
from typing import Any

RADIUS_TO_EDGE, MIN_ANGLE = 1.4, 10
"""Targets for TetGen. RADIUS_TO_EDGE is the largest ratio of circumradius to shortest edge. MIN_ANGLE is the
smallest dihedral angle [degrees]."""

ENVELOPE = 0.05
"""Largest distance of fTetWild's result from the surface, in cells. A smaller distance would add small
tetrahedra, which shorten the stable step."""


def by_tetgen(vertices: Any, triangles: Any, cell_size: float) -> tuple[Any, Any, Any]:
    """Run TetGen. Returns: vertices (n, 3), tetrahedra (m, 4), and the region of each tetrahedron, (m, 1).

    No tetrahedron is larger than a regular tetrahedron with edges of length `cell_size`.
    """
    import tetgen

    largest = cell_size**3 / math.sqrt(72.0)
    switches = f"pq{RADIUS_TO_EDGE}/{MIN_ANGLE}a{largest:.15f}AQ"
    points, tets, regions, _ = tetgen.TetGen(vertices, triangles).tetrahedralize(switches=switches)
    return points, tets, regions


def by_ftetwild(vertices: Any, triangles: Any, cell_size: float) -> tuple[Any, Any, Any]:
    """Run fTetWild. Returns: vertices (n, 3), tetrahedra (m, 4), and the region of each tetrahedron, (m, 1).

    All tetrahedra have region 0, because fTetWild returns only tetrahedra inside the surface.
    """
    import numpy as np
    import pytetwild

    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    points, tets = pytetwild.tetrahedralize(
        vertices, triangles, edge_length_abs=cell_size, epsilon=ENVELOPE * cell_size / diagonal
    )
    return points, tets, np.zeros((len(tets), 1))


def main() -> None:
    """Read a surface and write its tetrahedra."""
    method, seconds, *sys.path[:] = sys.argv[1:]
    # This timer is a C thread. It works even if the mesher blocks the interpreter or the game has ended.
    faulthandler.dump_traceback_later(float(seconds), exit=True)
    # Both packages import pyvista only for plots, and pyvista is slow to load. Use an empty module instead.
    sys.modules["pyvista"] = ModuleType("pyvista")
    import numpy as np

    with np.load("surface.npz") as file:
        surface = file["vertices"], file["triangles"], float(file["cell_size"])
    points, tets, regions = {"tetgen": by_tetgen, "ftetwild": by_ftetwild}[method](*surface)
    np.savez("tetrahedra.npz", vertices=points, tets=tets, regions=regions)


if __name__ == "__main__":
    main()
