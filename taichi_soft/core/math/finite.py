"""Test numbers for finiteness by their bits, because fast-math compilers may assume that NaN never occurs."""

from taichi_soft.core.runtime import ti

_EXPONENT = 0x7F800000


@ti.func
def is_finite(v):
    """Return 1 if each component of a vec3 is finite and in the range of float32, otherwise 0."""
    good = 1
    for i in ti.static(range(3)):
        if (ti.bit_cast(ti.cast(v[i], ti.f32), ti.i32) & _EXPONENT) == _EXPONENT:
            good = 0
    return good


@ti.func
def is_within(v, limit):
    """Return 1 if each component of a vec3 has an absolute value below `limit`, otherwise 0. NaN gives 0."""
    good = 1
    for i in ti.static(range(3)):
        good = good & int(ti.abs(v[i]) < limit)
    return good
