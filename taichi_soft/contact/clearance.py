"""Where a body may begin: not inside a collider, which would crush it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.description import outer_vertices
from taichi_soft.contact.collider import Collider
from taichi_soft.core.errors import OptionError

if TYPE_CHECKING:
    from taichi_soft.bodies.asset import SoftBodyAsset

BEARABLE = 0.25
"""Depth over the mean edge of the surface, or over the least side of the body, from which vertices that are
put outside at once may come too near the next ones."""


def require_clear(
    colliders: Sequence[Collider], asset: SoftBodyAsset, points: NDArray[np.float64], name: str
) -> None:
    """See that a body begins outside of all colliders that it touches, or not too deep in one.

    Args:
        points: its vertices that are not held, (n, 3) [m].
        name: of the body, for the message.
    Raises: OptionError with the deepest collider and the depth.
    """
    if not len(points):
        return
    deepest, which = 0.0, None
    for collider in colliders:
        contact, shape = asset.contact, collider.shape
        if contact.group & collider.mask and collider.group & contact.mask:
            # From world to collider: times its axes as columns, from the right.
            depths = shape.depths((points - collider.position) @ collider.rotation)
            depth = float(depths.max()) + collider.thickness
            if depth > deepest:
                deepest, which = depth, collider
    side = float(np.ptp(asset.mesh.vertices, axis=0).min())
    edge = asset.surface_row[2]
    bearable = BEARABLE * (min(edge, side) if side > 0.0 else edge)
    if which is not None and deepest > bearable:
        raise OptionError(
            f"{name} starts {deepest:.4g} m inside collider {which.index}, {which.shape!r}, and bears "
            f"{bearable:.3g} m: place it outside, or keep the two apart by group and mask"
        )


def free_points(asset: SoftBodyAsset, rows: NDArray[np.float32]) -> NDArray[np.float64]:
    """Outer vertices, or points of its hull, that are not pinned, (n, 3) [m], of a body that begins as `rows`
    (n, 8) say."""
    hull = asset.bound_hull
    if hull is not None:
        moves = (rows[hull.vertices, 6] > 0.0).any(axis=1)
        points: NDArray[np.float64] = asset.touching_points(rows[:, :3].astype(np.float64))[moves]
        return points
    outer = outer_vertices(asset.mesh)
    free = outer[rows[outer, 6] > 0.0]
    return rows[free, :3].astype(np.float64)
