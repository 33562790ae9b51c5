"""Check that a body does not start inside another body. The check raises an error, for callers who do not
want overlapping bodies to be moved apart.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taichi_soft.contact.filters import Filter, may_meet
from taichi_soft.core.errors import OptionError
from taichi_soft.meshing.locating import nearest_points

if TYPE_CHECKING:
    from taichi_soft.bodies.asset import SoftBodyAsset

Floats = NDArray[np.float64]

INSET = 0.02
"""Depth, relative to the mean edge, above which bodies count as overlapping. At smaller depths, contact moves
the bodies apart."""

RAY = np.array([[2**0.5, -1, 0], [1, 2**0.5, -(3**0.5)], [1, 2**0.5, 3**0.5]]) / np.sqrt([[3], [6], [6]])
"""Three perpendicular axes as rows. The third axis is the direction of the ray that decides whether a point
is inside. A ray in this direction meets no edge or vertex of usual meshes."""

CHUNK = 1 << 19
"""Number of pairs of points and triangles that are compared at once."""


class Placed(NamedTuple):
    """A body and its current vertex positions."""

    name: str
    asset: SoftBodyAsset
    tets: NDArray[np.int32]  # (m, 4)
    surface: NDArray[np.int32]  # (f, 3)
    positions: Floats  # (n, 3) [m]
    filter: Filter

    @property
    def corners(self) -> Floats:
        """Corners of the triangles of the body's contact surface, (t, 3, 3) [m]."""
        hull = self.asset.bound_hull
        if hull is not None:
            return np.asarray(self.asset.touching_points(self.positions)[hull.triangles])
        return np.asarray(self.positions[self.surface])


def require_apart(body: Placed, others: Iterable[Placed]) -> None:
    """Check that a body starts outside all other bodies that it can touch.

    Raises: OptionError that names the body with the deepest overlap, and the depth.
    """
    deepest, which = 0.0, None
    for other in others:
        if may_meet(body.filter, other.filter):
            depth = max(_depth(body, other), _depth(other, body))
            if depth > INSET * min(body.asset.surface_row[2], other.asset.surface_row[2]) and depth > deepest:
                deepest, which = depth, other
    if which is not None:
        raise OptionError(
            f"{body.name} starts {deepest:.4g} m inside {which.name}: place it elsewhere, keep the two apart "
            'by group and mask, or use overlap="part", which moves them apart'
        )


def _depth(body: Placed, other: Placed) -> float:
    """Return the largest depth of a vertex or tetrahedron centre of `body` in `other` [m].

    The result is 0 if no vertex and no centre is inside.
    """
    if not len(other.tets):
        return 0.0
    corners = other.corners
    points = np.concatenate([body.positions, body.positions[body.tets].mean(axis=1)])
    if body.asset.bound_hull is not None:
        points = body.asset.touching_points(body.positions)
    near = ((points > corners.min(axis=(0, 1))) & (points < corners.max(axis=(0, 1)))).all(axis=1)
    deepest, size = 0.0, max(1, CHUNK // len(corners))
    points = points[near]
    for first in range(0, len(points), size):
        few = points[first : first + size]
        few = few[_is_inside(few, corners)]
        pairs = np.repeat(few, len(corners), axis=0), np.tile(corners, (len(few), 1, 1))
        away = np.linalg.norm(nearest_points(*pairs) - pairs[0], axis=1).reshape(len(few), len(corners))
        deepest = max(deepest, float(away.min(axis=1).max(initial=0.0)))
    return deepest


def _is_inside(points: Floats, corners: Floats) -> NDArray[np.bool_]:
    """Return True for each point inside a closed surface, (n,).

    A ray from such a point leaves the surface more often than it enters the surface.
    Args: points: (n, 3) [m]. corners: corners of the triangles of the surface, (t, 3, 3) [m].
    """
    seen = corners @ RAY.T - (points @ RAY.T)[:, None, None]
    x, y, z = np.moveaxis(seen, -1, 0)
    areas = np.roll(x, -1, axis=-1) * np.roll(y, -2, axis=-1) - np.roll(x, -2, axis=-1) * np.roll(
        y, -1, axis=-1
    )
    total = areas.sum(axis=-1)
    side = np.sign(total)
    meets = (areas * side[..., None] > 0.0).all(axis=-1)
    ahead = (areas * z).sum(axis=-1) * side > 0.0
    return np.asarray((side * (meets & ahead)).sum(axis=-1) != 0.0)
