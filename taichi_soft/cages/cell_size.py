"""How large the cells of a cage are."""

from __future__ import annotations

import numpy as np

from taichi_soft.core.checks import as_count, as_positive
from taichi_soft.core.errors import MeshError, OptionError
from taichi_soft.meshing.arrays import FloatArray

DEFAULT_CELLS = 10
"""Along the longest side: some thousand tetrahedra, of which a game has many."""

MOST_CELLS = 150_000
"""In the box round the surface."""

BYTES_PER_CELL = 27 * 250
"""Of the voxels of a lattice in it, while the cage is made."""


def cell_size_of(size: FloatArray, cells: int | None, cell_size: float | None) -> float:
    """Edge of a cell [m].

    Args:
        size: of the box round the surface, (3,) [m].
        cells, cell_size: as of `SoftBodyAsset.from_surface`.
    Raises: OptionError for none, or too many of them; MeshError for a box without size.
    """
    longest = float(size.max())
    if not longest > 0.0:
        raise MeshError("the surface is a point: it encloses nothing")
    if cells is not None and cell_size is not None:
        raise OptionError(f"cells={cells!r} and cell_size={cell_size!r}: give one of them")
    if cell_size is None:
        edge = longest / as_count(DEFAULT_CELLS if cells is None else cells, "cells", 1, 1_000_000)
    else:
        edge = as_positive(cell_size, "cell_size", "m")
        if edge > 2.0 * longest:
            raise OptionError(f"cell_size is {edge:g} m, and the surface is {longest:g} m long: take less")
    count = float(np.prod(np.ceil(size / edge) + 2.0))
    if count > MOST_CELLS:
        raise OptionError(
            f"of cells of {edge:.4g} m {count:.3g} fill the box round the surface, which takes about "
            f"{count * BYTES_PER_CELL / 2**30:,.1f} GiB: stay below {MOST_CELLS:,}"
        )
    return edge
