"""Convert a collider to plain data for snapshots, and back."""

from __future__ import annotations

from typing import Any

import numpy as np

from taichi_soft.contact.collider import Collider, ColliderRow, row_of
from taichi_soft.contact.shapes import Shape
from taichi_soft.core.checks import as_count, as_flag, as_friction, as_number
from taichi_soft.core.constants import ALL_GROUPS
from taichi_soft.core.errors import SnapshotError
from taichi_soft.core.handles import serial_of
from taichi_soft.core.serialisation import digest_of, from_plain, plain_of, vector_of


def entry_of(collider: Collider) -> list[Any]:
    """Return handle number, row and motion of a collider as plain data. A grid is not included, only the
    digest of its shape.
    """
    row = row_of(collider)
    target = None if row.target is None else [each.tolist() for each in row.target]
    vectors = row.position, row.rotation, row.velocity, row.spin, row.surface_velocity
    motion = [each.tolist() for each in vectors]
    surface = [row.friction, row.restitution, row.thickness, row.group, row.mask]
    plain = None if len(row.shape.samples) else plain_of(row.shape)
    digest = digest_of(row.shape)
    flags = [row.is_alive, row.is_sensor]
    return [serial_of(collider), flags, digest, plain, row.offset, surface, motion, target]


def read_row(entry: list[Any], shapes: dict[str, Shape], room: int) -> ColliderRow:
    """Convert an entry to the row of a collider.

    Args:
        shapes: shapes that this world has had, by digest.
        room: number of grid samples for which the world has memory.
    Raises: ValueError, SnapshotError or OptionError for an invalid entry.
    """
    _, (is_alive, is_sensor), digest, plain, offset, surface, motion, target = entry
    shape = shapes.get(digest)
    if shape is None:
        shape = from_plain(plain)
    if not isinstance(shape, Shape):
        raise SnapshotError(
            "this snapshot has a collider with a grid that this world never had: before restoring, add (and "
            "remove again) one collider of each MeshShape and HeightFieldShape of the snapshot's world"
        )
    friction, restitution, thickness, group, mask = surface
    position, rotation, velocity, spin, surface_velocity = (
        vector_of(each, n) for each, n in zip(motion, (3, 4, 3, 3, 3), strict=True)
    )
    if abs(np.linalg.norm(rotation) - 1.0) > 1e-3:
        raise ValueError("a collider's rotation is no unit quaternion")
    row = ColliderRow(
        shape,
        as_friction(friction),
        -1.0 if restitution == -1.0 else as_number(restitution, "restitution", 0.0, 1.0),
        as_number(thickness, "thickness", 0.0, 1e3),
        as_count(group, "group", 0, ALL_GROUPS),
        as_count(mask, "mask", 0, ALL_GROUPS),
        position,
        rotation,
        velocity,
        spin,
        surface_velocity,
        as_count(offset, "offset", 0),
        None if target is None else (vector_of(target[0], 3), vector_of(target[1], 4)),
        as_flag(is_alive, "is_alive"),
        as_flag(is_sensor, "is_sensor"),
    )
    if not row.offset <= room - len(shape.samples):
        raise ValueError("a collider's grid lies outside the room for grids")
    return row
