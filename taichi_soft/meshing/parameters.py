"""Checks of the numbers a shape is made from."""

from __future__ import annotations

from numbers import Integral, Real
from typing import Any

import numpy as np

from taichi_soft.errors import OptionError


def positive(name: str, value: Any) -> float:
    """`value` as a float. Raises: OptionError unless it is one finite number above zero."""
    if not isinstance(value, Real) or isinstance(value, bool | np.bool_) or not 0 < float(value) < np.inf:
        raise OptionError(f"{name} is {value!r}: pass a positive number of metres")
    return float(value)


def count(name: str, value: Any, least: int = 1) -> int:
    """`value` as an int. Raises: OptionError unless it is a whole number, at least `least`."""
    if not isinstance(value, Integral) or isinstance(value, bool) or int(value) < least:
        raise OptionError(f"{name} is {value!r}: pass a whole number, {least} or more")
    return int(value)
