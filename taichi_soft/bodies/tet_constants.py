"""Write the constants of one body's tetrahedra after a change of material or a cut."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.fields import BodyFields
from taichi_soft.bodies.kernels.constant_rows import write_numbers
from taichi_soft.bodies.layout import BodyArrays, blocks_of
from taichi_soft.core.constants import LANES


def write_tet_constants(fields: BodyFields, first_block: int, body: BodyArrays) -> None:
    """Write the fields of `BodyFields.tet_constants` for one body. Its first block is `first_block`."""
    if len(body.tet_vertices):
        for field, rows in fields.tet_constants(body):
            write_numbers(field, first_block * LANES * rows.shape[1], constant_blocks(rows))


def constant_blocks(rows: NDArray[np.float64]) -> NDArray[np.float32]:
    """Rearrange constants of tetrahedra, (m, k), into the block layout of their field: see `BodyFields`."""
    return blocks_of(rows, rows.shape[1], 0).astype(np.float32)
