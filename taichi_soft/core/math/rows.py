"""Loops over rows that are compiled only once, and vectors in rows."""

from taichi_soft.core.constants import ROW_BITS
from taichi_soft.core.runtime import ti


@ti.func
def row_behind(row):
    """Return the next row of a `while` loop.

    LLVM makes vectorised and unrolled copies of loops with a known trip count, with up to ten times the code
    and a longer compile time. This function hides the trip count. Use it for loops that run rarely.
    """
    return (row + 1) & ROW_BITS


@ti.func
def row_at(rows: ti.template(), i, column):
    """Return three numbers of row i of an array, starting at `column`."""
    return ti.Vector([rows[i, column], rows[i, column + 1], rows[i, column + 2]])
