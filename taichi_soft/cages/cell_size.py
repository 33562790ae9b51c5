"""Choose the cell size of a cage."""

from __future__ import annotations

import numpy as np

from taichi_soft.core.checks import as_count, as_positive
from taichi_soft.core.errors import MeshError, OptionError
from taichi_soft.meshing.arrays import FloatArray

DEFAULT_CELLS = 10
"""Default number of cells along the longest side. It gives a few thousand tetrahedra, which are enough for
games."""

MAX_CELLS = 150_000
"""Largest number of cells in the bounding box of the surface."""

BYTES_PER_CELL = 27 * 250
"""Memory for the voxels of one cell while the cage is built [bytes]."""


def cell_size_of(size: FloatArray, cells: int | None, cell_size: float | None) -> float:
    """Return the edge of a cell [m].

    Args:
        size: lengths of the bounding box of the surface, (3,) [m].
        cells, cell_size: arguments of `SoftBodyAsset.from_surface`.
    Raises: OptionError for an invalid size or too many cells; MeshError for a surface without extent.
    """
    longest = float(size.max())
    if not longest > 0.0:
        raise MeshError("the surface is a point: it encloses nothing")
    if cells is not None and cell_size is not None:
        raise OptionError(f"cells={cells!r} and cell_size={cell_size!r}: pass only one of them")
    if cell_size is None:
        edge = longest / as_count(DEFAULT_CELLS if cells is None else cells, "cells", 1, 1_000_000)
    else:
        edge = as_positive(cell_size, "cell_size", "m")
        if edge > 2.0 * longest:
            raise OptionError(f"cell_size={edge:g} m, but the surface is only {longest:g} m long: reduce it")
    count = float(np.prod(np.ceil(size / edge) + 2.0))
    if count > MAX_CELLS:
        raise OptionError(
            f"{count:.3g} cells of {edge:.4g} m fill the bounding box of the surface and need about "
            f"{count * BYTES_PER_CELL / 2**30:,.1f} GiB: use at most {MAX_CELLS:,}, that is, larger cells"
        )
    return edge
