"""Loops over rows that compile to a single copy, and vectors in rows."""

from taichi_soft.core.constants import ROW_BITS
from taichi_soft.core.runtime import ti


@ti.func
def row_behind(row):
    """Next row of a `while` loop.

    LLVM makes vectorised and unrolled copies of loops with a known trip count, up to ten times the code,
    which increases compile time. This function hides the trip count. Use it for loops that run rarely.
    """
    return (row + 1) & ROW_BITS


@ti.func
def row_at(rows: ti.template(), i, column):
    """Three numbers of row i of an array, from a column on."""
    return ti.Vector([rows[i, column], rows[i, column + 1], rows[i, column + 2]])
