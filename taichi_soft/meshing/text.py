"""Decode and parse text files from various systems and programs."""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterable, Sequence
from itertools import chain

import numpy as np

from taichi_soft.core.errors import MeshError
from taichi_soft.meshing.arrays import FloatArray


def as_ascii(data: bytes) -> bytes:
    """Convert a text file so that keywords and numbers are ASCII (UTF-16 becomes UTF-8) and lines end in LF.

    Names in other encodings stay unchanged. `decoded` decodes these names.
    """
    return _as_bytes(data).replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def _as_bytes(data: bytes) -> bytes:
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", errors="replace").encode()
    for encoding, parity in (("utf-16-le", 1), ("utf-16-be", 0)):
        if len(data) > 1 and not any(data[parity:64:2]) and all(data[1 - parity : 64 : 2]):
            return data.decode(encoding, errors="replace").encode()
    return data.removeprefix(codecs.BOM_UTF8)


def decoded(name: bytes) -> str:
    """Decode a name as UTF-8 or, if that fails, as Latin-1."""
    try:
        return name.decode()
    except UnicodeDecodeError:
        return name.decode("latin-1")


def numbers(
    rows: Sequence[Sequence[bytes]], width: int, element: str, *, allow_missing: bool = False
) -> FloatArray:
    """Parse the first `width` numbers of each row, (n, width).

    Args:
        element: name of a row in error messages.
        allow_missing: True to return NaN for a row that has too few numbers or an invalid number.
    Raises: MeshError for such a row, unless `allow_missing` is True.
    """
    try:
        return np.fromiter(
            map(float, chain.from_iterable(row[:width] for row in rows)), np.float64, width * len(rows)
        ).reshape(-1, width)
    except ValueError:
        if allow_missing:
            missing = [b"nan"] * width
            return numbers([row if _has_numbers(row, width) else missing for row in rows], width, element)
        for index, row in enumerate(rows):
            words = b" ".join(row)
            if not _has_numbers(row, width):
                expected = "a number" if width == 1 else f"{width} numbers"
                raise MeshError(
                    f"{element} {index} is '{decoded(words)[:60]}': expected {expected}, with a decimal point"
                ) from None
        raise


def _has_numbers(row: Sequence[bytes], width: int) -> bool:
    return len(row) >= width and all(is_number(word) for word in row[:width])


def is_number(word: bytes) -> bool:
    """True if a word is a number."""
    try:
        float(word)
    except ValueError:
        return False
    return True


def without_comments(lines: Iterable[bytes]) -> list[list[bytes]]:
    """Split lines into words. Drop comments, which begin with #, and empty lines."""
    split = (re.sub(rb"#.*", b"", line).split() for line in lines)
    return [words for words in split if words]
