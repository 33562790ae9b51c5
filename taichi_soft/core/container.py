"""Container format for bytes: a magic mark, a version, parts of any length, and a checksum."""

from __future__ import annotations

import struct
from hashlib import blake2b
from typing import Any

from taichi_soft.core.errors import OptionError, SnapshotError

_HEAD = struct.Struct("<8sII")
_LENGTH = struct.Struct("<Q")
_DIGEST = 16


def seal(mark: bytes, version: int, parts: list[bytes]) -> bytes:
    """Return a container of the mark, the version, the lengths of the parts, the parts, and a BLAKE2b digest
    of everything before the digest.
    """
    lengths = [_LENGTH.pack(len(part)) for part in parts]
    whole = b"".join([_HEAD.pack(mark, version, len(parts)), *lengths, *parts])
    return whole + _digest(whole)


def unseal(data: Any, mark: bytes, version: int, name: str) -> list[memoryview]:
    """Check a container and return its parts.

    Raises: OptionError if `data` is not bytes; SnapshotError if the mark or the version differs, or if the
        data is damaged.
    """
    if not isinstance(data, (bytes, bytearray, memoryview)):
        raise OptionError(f"{name} must be bytes, got {type(data).__name__}")
    whole = memoryview(data).cast("B")
    if len(whole) < _HEAD.size + _DIGEST:
        raise SnapshotError(f"this is not a {name}: {len(whole)} bytes are too few, it is cut off or empty")
    found, made_by, count = _HEAD.unpack_from(whole)
    if found != mark:
        raise SnapshotError(f"this is not a {name}: it begins with {bytes(found)!r} instead of {mark!r}")
    if made_by != version:
        raise SnapshotError(
            f"this {name} has version {made_by}, and this package reads version {version}: use the package "
            "that made it"
        )
    if _digest(whole[:-_DIGEST]) != whole[-_DIGEST:]:
        raise SnapshotError(f"this {name} is damaged or cut off: its checksum is wrong. Transfer it again")
    at = _HEAD.size + count * _LENGTH.size
    parts = []
    for i in range(count):
        (length,) = _LENGTH.unpack_from(whole, _HEAD.size + i * _LENGTH.size)
        parts.append(whole[at : at + length])
        at += length
    return parts


def name_of_sealed(data: bytes) -> bytes:
    """Return the digest of a container. Containers with different content have different digests."""
    return bytes(memoryview(data).cast("B")[-_DIGEST:])


def _digest(whole: bytes | memoryview) -> bytes:
    return blake2b(whole, digest_size=_DIGEST).digest()
