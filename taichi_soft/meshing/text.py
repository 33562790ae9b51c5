"""Text files as programs of many systems write them."""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterable, Sequence
from itertools import chain

import numpy as np

from taichi_soft.core.errors import MeshError
from taichi_soft.meshing.arrays import FloatArray


def as_ascii(data: bytes) -> bytes:
    """A text whose keywords and numbers are ASCII, with line feeds as line ends. UTF-16 becomes UTF-8.

    Names stay in the encoding of the file otherwise: see `decoded`.
    """
    return _as_bytes(data).replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def _as_bytes(data: bytes) -> bytes:
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", errors="replace").encode()
    for encoding, place in (("utf-16-le", 1), ("utf-16-be", 0)):
        if len(data) > 1 and not any(data[place:64:2]) and all(data[1 - place : 64 : 2]):
            return data.decode(encoding, errors="replace").encode()
    return data.removeprefix(codecs.BOM_UTF8)


def decoded(name: bytes) -> str:
    """A name, which is UTF-8 or else Latin-1."""
    try:
        return name.decode()
    except UnicodeDecodeError:
        return name.decode("latin-1")


def numbers(rows: Sequence[Sequence[bytes]], width: int, what: str, *, may_lack: bool = False) -> FloatArray:
    """The first `width` numbers of each row, (n, width).

    Args:
        what: a row is, for errors.
        may_lack: make NaN of a row with fewer of them, or with a word that is no number.
    Raises: MeshError for such a row otherwise.
    """
    try:
        return np.fromiter(
            map(float, chain.from_iterable(row[:width] for row in rows)), np.float64, width * len(rows)
        ).reshape(-1, width)
    except ValueError:
        if may_lack:
            lacking = [b"nan"] * width
            return numbers([row if _has_numbers(row, width) else lacking for row in rows], width, what)
        for number, row in enumerate(rows):
            words = b" ".join(row)
            if not _has_numbers(row, width):
                wanted = "is a number" if width == 1 else f"are {width} numbers"
                raise MeshError(
                    f"{what} {number} is '{decoded(words)[:60]}': wanted {wanted}, with a decimal point"
                ) from None
        raise


def _has_numbers(row: Sequence[bytes], width: int) -> bool:
    return len(row) >= width and all(is_number(word) for word in row[:width])


def is_number(word: bytes) -> bool:
    """Whether a word is a number."""
    try:
        float(word)
    except ValueError:
        return False
    return True


def without_comments(lines: Iterable[bytes]) -> list[list[bytes]]:
    """The words of each line up to #, without lines that have none."""
    split = (re.sub(rb"#.*", b"", line).split() for line in lines)
    return [words for words in split if words]
