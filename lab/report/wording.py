"""Format numbers, points and durations as text."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from lab.experiments import Point


def plain(value: Any) -> Any:
    """Convert NumPy values to Python values."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    return value


def numeric_columns(rows: Sequence[Sequence[Any]], count: int) -> tuple[bool, ...]:
    """Return True for each of the `count` columns that contains only numbers and empty cells."""
    columns = [[plain(row[k]) for row in rows] for k in range(count)]
    filled = [[value for value in column if value is not None and value != ""] for column in columns]
    return tuple(bool(column) and all(_is_number(value) for value in column) for column in filled)


def _is_number(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        return False
    try:
        float(value)
    except ValueError:
        return False
    return True


def readable(value: Any) -> str:
    """Format a cell of a table: a number with four digits, yes or no for a boolean, a dash for None."""
    value = plain(value)
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return _digits(value)
    if isinstance(value, (list, tuple)):
        return ", ".join(readable(each) for each in value)
    return str(value)


def _digits(value: float) -> str:
    """Format a number with four digits: 1234.5 as 1234, 123456.0 as 1.235e5."""
    if 1e3 <= abs(value) < 1e5:
        return f"{value:.0f}"
    return re.sub(r"e([+-])0*(\d)", lambda power: "e" + power[1].strip("+") + power[2], f"{value:.4g}")


def legible(text: str) -> str:
    """Rewrite the numbers in a text: 8.3e+02 as 830, 1.1e-02 as 0.011, 5.6e+05 as 5.6e5."""
    return re.sub(r"(?<![\w.])(\d)(?:\.(\d+))?e([+-]\d+)", _plain_power, text)


def _plain_power(number: re.Match[str]) -> str:
    first, rest, power = number[1], number[2] or "", int(number[3])
    if -3 <= power < 5:
        return f"{float(number[0]):.{max(0, len(rest) - power)}f}"
    return f"{first}{'.' * bool(rest)}{rest}e{power}"


def point_line(point: Point) -> str:
    """Format a point in one line: "law = virial, young = 1e6"."""
    return ", ".join(f"{name} = {readable(value)}" for name, value in point.items())


def duration(seconds: float) -> str:
    """Format a duration in s, min or h."""
    if seconds < 100.0:
        return f"{seconds:.2g} s"
    if seconds < 6000.0:
        return f"{seconds / 60.0:.2g} min" if seconds < 600.0 else f"{seconds / 60.0:.0f} min"
    return f"{seconds / 3600.0:.1f} h"
