"""Test numbers for finiteness by their bits, because fast-math compilers may assume that NaN never occurs."""

from taichi_soft.core.runtime import ti

_EXPONENT = 0x7F800000


@ti.func
def is_finite(v):
    """1 if no component of a vec3 is NaN, infinite or beyond float32."""
    good = 1
    for i in ti.static(range(3)):
        if (ti.bit_cast(ti.cast(v[i], ti.f32), ti.i32) & _EXPONENT) == _EXPONENT:
            good = 0
    return good


@ti.func
def is_within(v, limit):
    """1 if the absolute value of every component of a vec3 is below `limit`; 0 for NaN."""
    good = 1
    for i in ti.static(range(3)):
        good = good & int(ti.abs(v[i]) < limit)
    return good
