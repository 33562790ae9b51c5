"""Pack binary messages for a visitor's page: meshes, and frames with positions.

A packet begins with its kind and its pane, one byte each. Numbers are little-endian. Positions are quantised
to 16 bits within the frame's bounding box: in a box of 10 m, the resolution is 0.15 mm.
"""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.live.frame_file import Frame

DRAWN, PICTURE = 1, 2
"""Kinds of packets: meshes, and frames."""

STEPS = 65535
"""Quantisation steps along an edge of the bounding box."""

LARGEST_BOX = np.float32(400.0)
"""Largest edge of the bounding box [m]. Points outside are clamped to the box."""

_PICTURE = struct.Struct("<BBHIIId3f3f")
"""Header of a frame: kind, pane, 1 if the frame has tints, number of the frame, version of the meshes, number
of vertices, world time [s], lower corner and size of the bounding box [m]."""


def drawn_packet(pane: int, header: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> bytes:
    """Pack meshes: a JSON header with the names of the arrays that follow, then the arrays."""
    named = {name: [str(each.dtype), list(each.shape)] for name, each in arrays.items()}
    text = json.dumps({**header, "arrays": named}).encode()
    text += b" " * (-(8 + len(text)) % 4)
    parts = [struct.pack("<BBHI", DRAWN, pane, 0, len(text)), text]
    for each in arrays.values():
        rows = np.ascontiguousarray(each).tobytes()
        parts += [rows, bytes(-len(rows) % 4)]
    return b"".join(parts)


def quantised(positions: NDArray[np.float32]) -> tuple[NDArray[np.uint16], NDArray[np.float32], Any]:
    """Quantise positions (n, 3) [m].

    Returns: integers (n, 3), lower corner and size of the bounding box [m].
    """
    if len(positions) == 0:
        return np.zeros((0, 3), np.uint16), np.zeros(3, np.float32), np.ones(3, np.float32)
    low, high = positions.min(axis=0), positions.max(axis=0)
    if float((high - low).max()) > LARGEST_BOX:  # a body flew away; keep the resolution of the other bodies
        middle = np.median(positions, axis=0)
        positions = np.clip(positions, middle - LARGEST_BOX / 2, middle + LARGEST_BOX / 2)
        low, high = positions.min(axis=0), positions.max(axis=0)
    size = np.maximum(high - low, np.float32(1e-6))
    return ((positions - low) * (STEPS / size) + 0.5).astype(np.uint16), low, size


def numbered(packet: bytes, number: int) -> bytes:
    """Return a copy of a frame's packet with the frame number replaced by `number`.

    This number counts the frames that were sent to one visitor.
    """
    return packet[:4] + struct.pack("<I", number & 0xFFFFFFFF) + packet[8:]


def picture_packet(pane: int, frame: Frame) -> bytes:
    """Pack a frame for a page."""
    rows, low, size = quantised(frame.positions)
    normals = np.zeros((len(rows), 4), np.int8)
    normals[:, :3] = np.rint(frame.normals * 127.0)
    if frame.is_tinted:
        normals[:, 3] = (frame.tints >> 1).astype(np.int8)
    numbers = pane, frame.is_tinted, frame.number & 0xFFFFFFFF, frame.version, len(rows), frame.time
    head = _PICTURE.pack(PICTURE, *numbers, *low.tolist(), *size.tolist())
    return b"".join([head, frame.poses.tobytes(), normals.tobytes(), rows.tobytes()])
