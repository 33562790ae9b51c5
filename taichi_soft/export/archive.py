"""Named arrays in one file, as the native library reads it.

    32 bytes   mark, version (u32), number of entries (u32), bytes of all entries (u64), their CRC-32 (u32), 0
    entries    length of the name, type, dimensions, 0 (u32 each); sizes (u64 each); the name; the numbers

Names and numbers are filled up to multiples of 8 bytes. All is little-endian.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

MARK, VERSION = b"TSOFTWLD", 2

TYPES = {np.dtype(name): code for code, name in enumerate(("u1", "<i4", "<i8", "<f4", "<f8"), start=1)}


def written(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Arrays of one of `TYPES` as bytes."""
    parts = []
    for name, array in arrays.items():
        text, whole = name.encode(), np.ascontiguousarray(array)
        parts.append(struct.pack("<IIII", len(text), TYPES[whole.dtype], whole.ndim, 0))
        parts.append(struct.pack(f"<{whole.ndim}Q", *whole.shape))
        parts += [_filled_up(text), _filled_up(whole.tobytes())]
    entries = b"".join(parts)
    head = struct.pack("<8sIIQII", MARK, VERSION, len(arrays), len(entries), zlib.crc32(entries), 0)
    return head + entries


def words(texts: Sequence[str]) -> NDArray[np.uint8]:
    """Texts as an array: each with a zero behind it."""
    return np.frombuffer(b"".join(text.encode() + b"\0" for text in texts), dtype=np.uint8)


def _filled_up(data: bytes) -> bytes:
    return data + b"\0" * (-len(data) % 8)
