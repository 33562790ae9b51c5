"""Finite or not, decided on the bits: fast-math compilers may assume that NaN never happens."""

from taichi_soft.core.runtime import ti

_EXPONENT = 0x7F800000


@ti.func
def is_finite(v):
    """True (1) where no component of a vec3 is NaN, infinite or beyond float32."""
    good = 1
    for i in ti.static(range(3)):
        if (ti.bit_cast(ti.cast(v[i], ti.f32), ti.i32) & _EXPONENT) == _EXPONENT:
            good = 0
    return good


@ti.func
def is_within(v, limit):
    """Whether every component of a vec3 is nearer to zero than `limit` (1), which NaN is not."""
    good = 1
    for i in ti.static(range(3)):
        good = good & int(ti.abs(v[i]) < limit)
    return good
