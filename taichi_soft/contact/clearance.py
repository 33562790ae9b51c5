"""Check that a body does not start inside a collider, because contact would then crush it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.description import outer_vertices
from taichi_soft.contact.collider import Collider
from taichi_soft.contact.filters import Filter, may_meet
from taichi_soft.core.errors import OptionError

if TYPE_CHECKING:
    from taichi_soft.bodies.asset import SoftBodyAsset

MAX_DEPTH = 0.25
"""Largest depth of a vertex in a collider at the start, relative to the mean edge of the surface or to the
smallest side of the body, whichever is shorter. Contact moves vertices out in one step. Deeper vertices could
end too close to their neighbours."""


def require_clear(
    colliders: Sequence[Collider],
    asset: SoftBodyAsset,
    points: NDArray[np.float64],
    name: str,
    own_filter: Filter | None = None,
) -> None:
    """Check that a body starts outside all colliders that it can touch, or at most slightly inside.

    Args:
        points: vertices of the body that are not pinned, (n, 3) [m].
        name: name of the body for the message.
        own_filter: group and mask of the body; None for those of its asset.
    Raises: OptionError that names the collider in which the body starts deepest, and the depth.
    """
    if not len(points):
        return
    deepest, which = 0.0, None
    mine = asset.contact.filter if own_filter is None else own_filter
    for collider in colliders:
        shape = collider.shape
        if may_meet(mine, (collider.group, collider.mask)) and not collider.is_sensor:
            # Multiplying row vectors by the matrix of axes converts them to the collider's frame.
            depths = shape.depths((points - collider.position) @ collider.rotation)
            depth = float(depths.max()) + collider.thickness
            if depth > deepest:
                deepest, which = depth, collider
    side = float(np.ptp(asset.mesh.vertices, axis=0).min())
    edge = asset.surface_row[2]
    allowed = MAX_DEPTH * (min(edge, side) if side > 0.0 else edge)
    if which is not None and deepest > allowed:
        raise OptionError(
            f"{name} starts {deepest:.4g} m inside collider {which.index}, {which.shape!r}; at most "
            f"{allowed:.3g} m is allowed: place it outside, or keep the two apart by group and mask"
        )


def free_points(asset: SoftBodyAsset, rows: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the positions of a body's outer vertices that are not pinned, (n, 3) [m].

    For a body with a hull, these are the hull points that are not pinned.
    Args:
        rows: initial state of the body, (k, 8), see `SoftBodyAsset.placed`.
    """
    hull = asset.bound_hull
    if hull is not None:
        moves = (rows[hull.vertices, 6] > 0.0).any(axis=1)
        points: NDArray[np.float64] = asset.touching_points(rows[:, :3].astype(np.float64))[moves]
        return points
    outer = outer_vertices(asset.mesh)
    free = outer[rows[outer, 6] > 0.0]
    return rows[free, :3].astype(np.float64)
