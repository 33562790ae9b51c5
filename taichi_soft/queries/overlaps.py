"""Bodies that touch a sphere or a box."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.core.checks import as_number, as_rotation, as_vector
from taichi_soft.core.constants import POSITION_LIMIT
from taichi_soft.core.errors import OptionError
from taichi_soft.queries.kernels.bodies import find_overlaps
from taichi_soft.queries.query import Targets


@dataclass(frozen=True, eq=False)
class Overlap:
    """A body that touches a shape."""

    body: SoftBody  # the body that overlaps the shape
    vertices: NDArray[np.int32]  # vertices in the shape, ascending; empty if only faces or the inside overlap


MIN_SIZE = 1e-9
"""Smallest size of a shape [m]. The squares of smaller lengths underflow in float32."""


def find_in_sphere(targets: Targets, center: ArrayLike, radius: float) -> tuple[Overlap, ...]:
    """Return the bodies that touch a sphere. Raises: OptionError, see `World.overlap_sphere`."""
    shape = np.zeros((5, 3), dtype=np.float32)
    shape[0] = as_vector(center, "center", "m")
    shape[1:4] = np.eye(3)
    shape[4] = as_number(radius, "radius", MIN_SIZE, POSITION_LIMIT, "a length above 0 m")
    return _overlaps(targets, False, shape)


def find_in_box(targets: Targets, center: ArrayLike, size: ArrayLike, rotation: Any) -> tuple[Overlap, ...]:
    """Return the bodies that touch a box. Raises: OptionError, see `World.overlap_box`."""
    shape = np.zeros((5, 3), dtype=np.float32)
    shape[0] = as_vector(center, "center", "m")
    shape[1:4] = as_rotation(rotation).T
    lengths = as_vector(size, "size", "m")
    if not (lengths >= MIN_SIZE).all():
        raise OptionError(f"size must be three lengths above 0 m, got {lengths.tolist()}")
    shape[4] = lengths
    return _overlaps(targets, True, shape)


def _overlaps(targets: Targets, is_box: bool, shape: NDArray[np.float32]) -> tuple[Overlap, ...]:
    first_vertex = np.full(len(targets.slots), -1, dtype=np.int32)
    inside = np.zeros(targets.state.capacity.particles, dtype=np.int32)
    if len(targets.bodies):
        find_overlaps(targets.state, int(is_box), targets.bodies, shape, first_vertex, inside)
    overlaps = []
    for index in np.flatnonzero(first_vertex >= 0).tolist():
        begin, body = first_vertex[index], targets.slots[index]
        assert body is not None
        vertices = np.flatnonzero(inside[begin : begin + body.vertex_count])
        overlaps.append(Overlap(body, vertices.astype(np.int32)))
    return tuple(overlaps)
