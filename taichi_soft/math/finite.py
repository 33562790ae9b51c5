"""Finite or not, decided on the bits: fast-math compilers may assume that NaN never happens."""

from taichi_soft.constants import POSITION_LIMIT
from taichi_soft.runtime import ti

_EXPONENT = 0x7F800000


@ti.func
def is_finite(v):
    """True (1) where no component of a float32 vec3 is NaN or infinite."""
    good = 1
    for i in ti.static(range(3)):
        if (ti.bit_cast(v[i], ti.i32) & _EXPONENT) == _EXPONENT:
            good = 0
    return good


@ti.func
def is_in_reach(position):
    """True (1) where a position is finite and nearer than `POSITION_LIMIT`."""
    good = is_finite(position)
    for i in ti.static(range(3)):
        if not (ti.abs(position[i]) < POSITION_LIMIT):
            good = 0
    return good
