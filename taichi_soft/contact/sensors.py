"""Find the bodies in sensors: colliders that bodies do not touch."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from taichi_soft.contact.collider import ColliderRow
from taichi_soft.contact.kernels.sensors import POSE_WIDTH, find_bodies_inside


def inside_sensors(state: Any, slots: int, sensors: Mapping[int, ColliderRow]) -> list[tuple[int, int]]:
    """Return the slot of each body in a sensor, with the index of that sensor, ascending.

    Args:
        slots: number of slots for bodies.
        sensors: rows of the sensors to test, by index.
    """
    who = np.array([(c, row.group, row.mask) for c, row in sensors.items()]).reshape(-1, 3)
    poses = np.zeros((len(sensors), POSE_WIDTH), dtype=np.float32)
    for line, row in zip(poses, sensors.values(), strict=True):
        line[:] = np.concatenate([row.position, row.rotation, *row.box])
    inside = np.zeros((len(sensors), slots), dtype=np.int32)
    if len(sensors):
        find_bodies_inside(state, slots, who.astype(np.uint32).view(np.int32), poses, inside)
    found = [(int(slot), int(who[line, 0])) for line, slot in np.argwhere(inside)]
    return sorted(found)
