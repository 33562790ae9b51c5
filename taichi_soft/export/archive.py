"""Write named arrays to one file that the native library reads.

    header     magic (8 bytes), version (u32), number of entries (u32), size of all entries (u64) [bytes],
               CRC-32 of all entries (u32), 0 (u32)
    entries    length of the name, type, number of dimensions, 0 (u32 each); shape (u64 each); name; data

Names and data are padded to multiples of 8 bytes. All values are little-endian.
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
    """Return the bytes of a file that contains the arrays. Their types must be in `TYPES`."""
    parts = []
    for name, array in arrays.items():
        text, whole = name.encode(), np.ascontiguousarray(array)
        parts.append(struct.pack("<IIII", len(text), TYPES[whole.dtype], whole.ndim, 0))
        parts.append(struct.pack(f"<{whole.ndim}Q", *whole.shape))
        parts += [_padded(text), _padded(whole.tobytes())]
    entries = b"".join(parts)
    head = struct.pack("<8sIIQII", MARK, VERSION, len(arrays), len(entries), zlib.crc32(entries), 0)
    return head + entries


def words(texts: Sequence[str]) -> NDArray[np.uint8]:
    """Return texts as one array of zero-terminated UTF-8 strings."""
    return np.frombuffer(b"".join(text.encode() + b"\0" for text in texts), dtype=np.uint8)


def _padded(data: bytes) -> bytes:
    return data + b"\0" * (-len(data) % 8)
