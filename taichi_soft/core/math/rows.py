"""Loops over rows of which one copy is compiled."""

from taichi_soft.core.constants import ROW_BITS
from taichi_soft.core.runtime import ti


@ti.func
def row_behind(row):
    """The next row, in a loop with `while`.

    LLVM makes vector and unrolled copies of a loop whose turns it can count beforehand: up to ten times the
    code of the loop, which every start of a game compiles anew. By this it cannot count. For loops that run
    seldom.
    """
    return (row + 1) & ROW_BITS
