"""What runs in the process of a mesher, from surface.npz to tetrahedra.npz in the folder where it begins.

It is handed to an interpreter as text, and imports nothing of this package: that would start Taichi.
Arguments: the method, seconds after which the process ends by itself whatever it does, and `sys.path`.
"""

from __future__ import annotations

import faulthandler
import math
import sys
from types import ModuleType
from typing import Any

RADIUS_TO_EDGE, LEAST_ANGLE = 1.4, 10
"""What TetGen tries to keep: circumradius over shortest edge, dihedral angle [degrees]."""

ENVELOPE = 0.05
"""Of a cell: how far fTetWild may leave the surface. What is finer makes steps short and nothing else."""


def by_tetgen(vertices: Any, triangles: Any, cell_size: float) -> tuple[Any, Any, Any]:
    """Vertices (n, 3), tetrahedra (m, 4), and a number for each that tells regions apart, (m, 1).

    Tetrahedra are at most as large as a regular one with edges of a cell.
    """
    import tetgen

    largest = cell_size**3 / math.sqrt(72.0)
    switches = f"pq{RADIUS_TO_EDGE}/{LEAST_ANGLE}a{largest:.15f}AQ"
    points, tets, regions, _ = tetgen.TetGen(vertices, triangles).tetrahedralize(switches=switches)
    return points, tets, regions


def by_ftetwild(vertices: Any, triangles: Any, cell_size: float) -> tuple[Any, Any, Any]:
    """The same; it tells by itself what is inside: there is one region."""
    import numpy as np
    import pytetwild

    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    points, tets = pytetwild.tetrahedralize(
        vertices, triangles, edge_length_abs=cell_size, epsilon=ENVELOPE * cell_size / diagonal
    )
    return points, tets, np.zeros((len(tets), 1))


def main() -> None:
    """Read a surface, and write its tetrahedra."""
    method, seconds, *sys.path[:] = sys.argv[1:]
    # A thread of C, which works where the mesher holds the interpreter, and where the game is gone.
    faulthandler.dump_traceback_later(float(seconds), exit=True)
    # Both packages import it and use it for pictures only. It need not be there, and takes seconds to load.
    sys.modules["pyvista"] = ModuleType("pyvista")
    import numpy as np

    with np.load("surface.npz") as file:
        surface = file["vertices"], file["triangles"], float(file["cell_size"])
    points, tets, regions = {"tetgen": by_tetgen, "ftetwild": by_ftetwild}[method](*surface)
    np.savez("tetrahedra.npz", vertices=points, tets=tets, regions=regions)


if __name__ == "__main__":
    main()
