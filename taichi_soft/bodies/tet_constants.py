"""Constants of the tetrahedra of one body, written anew where it has got another material or was cut."""

from __future__ import annotations

import numpy as np

from taichi_soft.bodies.fields import BodyFields
from taichi_soft.bodies.kernels.constant_rows import write_numbers
from taichi_soft.bodies.layout import BodyArrays, blocks_of
from taichi_soft.core.constants import LANES


def write_tet_constants(fields: BodyFields, first_block: int, body: BodyArrays) -> None:
    """Write what `BodyFields.tet_constants` names."""
    if len(body.tet_vertices):
        for field, rows in fields.tet_constants(body):
            width = rows.shape[1]
            numbers = blocks_of(rows, width, 0).astype(np.float32)
            write_numbers(field, first_block * LANES * width, numbers)
