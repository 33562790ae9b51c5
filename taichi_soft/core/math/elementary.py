"""Elementary functions that use only arithmetic, so that every processor and system computes the same bits.

The functions of C libraries, such as `expf`, differ in their last bits between systems. Here, arguments are
reduced to a range near 0, in which Taylor series are short. The error is at most 4 ulps.
"""

import math
from dataclasses import dataclass
from typing import Any

from taichi_soft.core.runtime import ti


@dataclass(frozen=True)
class _Kind:
    """Constants of a floating-point format."""

    real: Any
    whole: Any  # integer type of the same width
    fraction: int  # number of bits of the fraction
    bias: int  # bias of the exponent
    root_half: int  # bit pattern of the square root of 1/2
    largest: float  # largest x for which e^x and e^-x are normal numbers
    ln2: tuple[float, float]  # log(2) in two parts; the product of the first part and any exponent is exact
    terms: tuple[int, int, int, int]  # number of terms for exp, for log, for cosine and sine, for atan


_SINGLE = _Kind(
    real=ti.f32,
    whole=ti.i32,
    fraction=23,
    bias=127,
    root_half=0x3F3504F3,
    largest=87.0,
    ln2=(float.fromhex("0x1.62ep-1"), float.fromhex("0x1.0bfbe8e7bcd5ep-15")),
    terms=(6, 5, 5, 9),
)
_DOUBLE = _Kind(
    real=ti.f64,
    whole=ti.i64,
    fraction=52,
    bias=1023,
    root_half=0x3FE6A09E667F3BCD,
    largest=708.0,
    ln2=(float.fromhex("0x1.62e42feep-1"), float.fromhex("0x1.a39ef35793c76p-33")),
    terms=(12, 11, 9, 21),
)
_LOG2_E, _TAN_EIGHTH = 1.0 / math.log(2.0), math.tan(math.pi / 8.0)
_HALF_PI = float.fromhex("0x1.921fb544p+0"), float.fromhex("0x1.0b4611a626331p-34")
"""pi / 2 in two parts. In 64 bits, the product of the first part with any integer below 2^20 is exact."""

# Coefficients of the series without their first terms. The first terms are 1 + x for exp, 2 s for log, 1 for
# cosine, and x for sine and arctangent.
_EXP = [1.0 / math.factorial(k) for k in range(2, 14)]
_LOG = [2.0 / (2 * k + 1) for k in range(1, 12)]
_COS = [(-1.0) ** k / math.factorial(2 * k) for k in range(1, 10)]
_SIN = [(-1.0) ** k / math.factorial(2 * k + 1) for k in range(1, 10)]
_ATAN = [(-1.0) ** k / (2 * k + 1) for k in range(1, 22)]


def _is_double(x: Any) -> bool:
    """True if a number of the current kernel has 64 bits."""
    return bool(x.ptr.get_rvalue_type() == ti.f64)


@ti.func
def _series(coefficients: ti.template(), count: ti.template(), x, kind: ti.template()):
    """Return the sum of coefficients[k] x^k for k below `count`.

    The coefficients are cast, because Taichi's constants have 32 bits.
    """
    total = kind.real(coefficients[count - 1])
    for k in ti.static(range(count - 2, -1, -1)):
        total = total * x + kind.real(coefficients[k])
    return total


@ti.func
def _exp(x, kind: ti.template()):
    near = ti.min(ti.max(x, kind.real(-kind.largest)), kind.real(kind.largest))
    times = ti.floor(near * kind.real(_LOG2_E) + kind.real(0.5))
    rest = (near - times * kind.real(kind.ln2[0])) - times * kind.real(kind.ln2[1])
    exponent = ti.cast(times, kind.whole) + kind.whole(kind.bias)
    power = ti.bit_cast(exponent << kind.whole(kind.fraction), kind.real)  # 2^times
    found = kind.real(1.0) + (rest + rest * rest * _series(_EXP, kind.terms[0], rest, kind))
    return ti.select(x < kind.real(-kind.largest), kind.real(0.0), found * power)


@ti.func
def _log(x, kind: ti.template()):
    # Without the cast, Taichi 1.7 converts the bits of a parameter as if they were a number, and crashes.
    bits = ti.bit_cast(ti.cast(x, kind.real), kind.whole)
    # The fraction m is in [sqrt(1/2), sqrt(2)), close to 1.
    exponent = (bits - kind.whole(kind.root_half)) >> kind.whole(kind.fraction)
    m = ti.bit_cast(bits - (exponent << kind.whole(kind.fraction)), kind.real)
    s = (m - kind.real(1.0)) / (m + kind.real(1.0))
    times, square = ti.cast(exponent, kind.real), s * s
    found = kind.real(2.0) * s + s * square * _series(_LOG, kind.terms[1], square, kind)
    return (found + times * kind.real(kind.ln2[1])) + times * kind.real(kind.ln2[0])


@ti.func
def _cos_sin(x, kind: ti.template()):
    wide = ti.cast(x, ti.f64)
    times = ti.floor(wide * ti.f64(2.0 / math.pi) + ti.f64(0.5))
    rest = ti.cast((wide - times * ti.f64(_HALF_PI[0])) - times * ti.f64(_HALF_PI[1]), kind.real)
    square = rest * rest
    cosine = kind.real(1.0) + square * _series(_COS, kind.terms[2], square, kind)
    sine = rest + rest * square * _series(_SIN, kind.terms[2], square, kind)
    quarter = ti.cast(times, ti.i32) & 3
    is_odd, is_back = (quarter & 1) == 1, quarter >= 2
    along, across = ti.select(is_odd, -sine, cosine), ti.select(is_odd, cosine, sine)
    return ti.select(is_back, -along, along), ti.select(is_back, -across, across)


@ti.func
def _atan2(y, x, kind: ti.template()):
    up, along = ti.abs(y), ti.abs(x)
    longer = ti.max(up, along)
    t = ti.min(up, along) / ti.select(longer > 0, longer, kind.real(1.0))
    is_steep = t > kind.real(_TAN_EIGHTH)
    t = ti.select(is_steep, (t - kind.real(1.0)) / (t + kind.real(1.0)), t)
    square = t * t
    angle = t + t * square * _series(_ATAN, kind.terms[3], square, kind)
    angle = ti.select(is_steep, kind.real(math.pi / 4.0) + angle, angle)
    angle = ti.select(up > along, kind.real(math.pi / 2.0) - angle, angle)
    angle = ti.select(x < 0, kind.real(math.pi) - angle, angle)
    return ti.select(y < 0, -angle, angle)


@ti.func
def exp(x):
    """Return e^x, but at most e^87, and 0 for x below -87. With 64 bits, the limits are 708 and -708."""
    return _exp(x, _DOUBLE) if ti.static(_is_double(x)) else _exp(x, _SINGLE)


@ti.func
def log(x):
    """Return the natural logarithm of a normal positive number."""
    return _log(x, _DOUBLE) if ti.static(_is_double(x)) else _log(x, _SINGLE)


@ti.func
def exp_each(v):
    """Return `exp` of each component of a vec3."""
    return ti.Vector([exp(v[0]), exp(v[1]), exp(v[2])])


@ti.func
def log_each(v):
    """Return `log` of each component of a vec3."""
    return ti.Vector([log(v[0]), log(v[1]), log(v[2])])


@ti.func
def cos_sin(x):
    """Return the cosine and the sine of an angle [rad] with an absolute value below 10^6."""
    return _cos_sin(x, _DOUBLE) if ti.static(_is_double(x)) else _cos_sin(x, _SINGLE)


@ti.func
def atan2(y, x):
    """Return the angle from the x axis to (x, y), from -pi to pi [rad]; 0 for (0, 0)."""
    return _atan2(y, x, _DOUBLE) if ti.static(_is_double(x)) else _atan2(y, x, _SINGLE)


@ti.func
def acos(x):
    """Return the angle [rad] whose cosine is x, a number from -1 to 1."""
    return atan2(ti.sqrt((1.0 - x) * (1.0 + x)), x)
