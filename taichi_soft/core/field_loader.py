"""Write NumPy arrays to many fields with one kernel.

Compiling a separate kernel for each field would take longer than compiling the step.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.runtime import holds_fields, ti


@holds_fields
class Loader:
    """Fields that are always written together, in the same order."""

    def __init__(self) -> None:
        """Start without fields. The first `write` determines the fields and their order."""
        self.pieces: list[tuple[Any, int, int, int]] = []
        self._waiting: list[tuple[Any, NDArray[Any]]] = []

    def fill(self, field: Any, rows: NDArray[Any]) -> None:
        """Prepare to set the first rows of a field to `rows`, and all other rows to zero.

        `write` writes the numbers. The field must have at most one dimension.
        """
        width = getattr(field, "n", 1)
        whole = np.zeros((_rows_of(field), width), np.int32 if field.dtype == ti.i32 else np.float64)
        if len(rows):
            whole[: len(rows)] = rows.reshape(len(rows), width)
        self._waiting.append((field, whole.reshape(-1)))

    def fill_all(self, field: Any, number: float) -> None:
        """Prepare to set all numbers of a field to `number`.

        `write` writes the numbers. The field must have at most one dimension.
        """
        rows = np.full(_rows_of(field) * getattr(field, "n", 1), number)
        self._waiting.append((field, rows.astype(np.int32 if field.dtype == ti.i32 else np.float64)))

    def write(self) -> None:
        """Write all fields that `fill` and `fill_all` have prepared."""
        reals, wholes = [np.zeros(1)], [np.zeros(1, np.int32)]
        pieces, sizes = [], [1, 1]
        for field, rows in self._waiting:
            is_whole = int(rows.dtype == np.int32)
            (wholes if is_whole else reals).append(rows)
            pieces.append((field, getattr(field, "n", 1), is_whole, sizes[is_whole]))
            sizes[is_whole] += len(rows)
        self._waiting.clear()
        if not self.pieces:
            self.pieces = pieces
        assert [id(piece[0]) for piece in pieces] == [id(piece[0]) for piece in self.pieces]
        _write_pieces(self, np.concatenate(reals), np.concatenate(wholes))


def _rows_of(field: Any) -> int:
    return int(field.shape[0]) if field.shape else 1


@ti.kernel
def _write_pieces(
    loader: ti.template(),
    reals: ti.types.ndarray(dtype=ti.f64, ndim=1),
    wholes: ti.types.ndarray(dtype=ti.i32, ndim=1),
):
    for field, width, is_whole, start in ti.static(loader.pieces):
        # Write a few fields, such as those of a collider, serially: starting threads would take longer than
        # the loops. Write many fields in parallel: Taichi compiles serial loops into one function, which then
        # takes much longer to compile than one function per field.
        ti.loop_config(serialize=ti.static(len(loader.pieces) < 20))
        for i in range(ti.static(_rows_of(field))):
            for k in ti.static(range(width)):
                value = (
                    wholes[start + i * width + k]
                    if ti.static(is_whole == 1)
                    else reals[start + i * width + k]
                )
                number = ti.cast(value, field.dtype)
                if ti.static(len(field.shape) == 0 and width == 1):
                    field[None] = number
                elif ti.static(len(field.shape) == 0):
                    field[None][k] = number
                elif ti.static(width == 1):
                    field[i] = number
                else:
                    field[i][k] = number
