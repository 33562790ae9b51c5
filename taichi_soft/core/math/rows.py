"""Functions for loops over rows, and for vectors that are stored in rows."""

from taichi_soft.core.constants import ROW_BITS
from taichi_soft.core.runtime import ti


@ti.func
def row_behind(row):
    """Return the number of the next row in a `while` loop, and hide the trip count of the loop from LLVM.

    If LLVM knows the trip count of a loop, it makes vectorised and unrolled copies of the loop, with up to
    ten times the code and a longer compile time. Use this function for loops that run rarely.
    """
    return (row + 1) & ROW_BITS


@ti.func
def row_at(rows: ti.template(), i, column):
    """Return three numbers of row i of an array, from `column` on, as a vec3."""
    return ti.Vector([rows[i, column], rows[i, column + 1], rows[i, column + 2]])
