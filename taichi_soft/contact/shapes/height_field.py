"""The shape of ground, defined by heights on a grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.contact.distances.shape_kind import ShapeKind
from taichi_soft.contact.shapes.shape import LONGEST, Shape, Triangles, as_length
from taichi_soft.core.checks import as_array
from taichi_soft.core.errors import OptionError
from taichi_soft.core.serialisation import serialised
from taichi_soft.meshing.arrays import read_only

MAX_NODES = 20_000_000
"""Largest number of nodes of a grid. They take 80 MB. A square of 4,097 x 4,097 nodes is possible."""


@serialised("heights", "spacing")
@dataclass(frozen=True, eq=False)
class HeightFieldShape(Shape):
    """Ground over a rectangle centred on the origin, solid from the surface down to infinity.

    The diagonal from node (i, j) to node (i + 1, j + 1) splits each cell into two triangles. Nothing is solid
    outside the rectangle.
    Args:
        heights: heights of the nodes (i, j), with i along x, (nx, ny) [m].
        spacing: distance between neighbouring nodes along both axes [m].
    Raises: OptionError for fewer than two nodes along an axis, too many nodes, or heights that are not
    finite.
    """

    kind = ShapeKind.HEIGHT_FIELD
    heights: ArrayLike
    spacing: float

    def __post_init__(self) -> None:
        heights = as_array(self.heights, "heights", (None, None), "m").astype(np.float32)
        if min(heights.shape) < 2 or heights.size > MAX_NODES:
            raise OptionError(
                f"heights must have 2 nodes or more along each axis and at most {MAX_NODES:,} in all, "
                f"got shape {heights.shape}"
            )
        if not np.abs(heights).max() <= LONGEST:
            raise OptionError(f"heights must lie within {LONGEST:g} m, got up to {np.abs(heights).max():g} m")
        object.__setattr__(self, "heights", read_only(heights))
        object.__setattr__(self, "spacing", as_length(self.spacing, "spacing"))

    def __repr__(self) -> str:
        (nx, ny, _), heights = self.resolution, np.asarray(self.heights)
        return (
            f"HeightFieldShape({nx} x {ny} nodes, spacing={self.spacing:.6g}, heights from "
            f"{heights.min():.6g} to {heights.max():.6g} m)"
        )

    def _values(self) -> tuple[float, ...]:
        heights = np.asarray(self.heights, dtype=np.float64)
        along, across = (np.abs(np.diff(heights, axis=axis)).max() / self.spacing for axis in (0, 1))
        # No triangle is steeper than the steepest edges along x and along y combined.
        cosine = 1.0 / np.sqrt(1.0 + along**2 + across**2)
        return (self.spacing, heights.min(), heights.max(), cosine)

    @property
    def resolution(self) -> tuple[int, int, int]:
        """Number of nodes along x, along y, and 1 for z."""
        nx, ny = np.shape(self.heights)
        return (nx, ny, 1)

    @property
    def samples(self) -> NDArray[np.float32]:
        """Heights of the nodes [m], y fastest, float32 (k,)."""
        return np.asarray(self.heights).reshape(-1)

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Lower and upper corner of the bounding box, (2, 3) [m]. The lower corner is at z = -infinity."""
        half = (np.array(np.shape(self.heights)) - 1) * self.spacing / 2
        top = float(np.max(self.heights))
        corners: NDArray[np.float64] = read_only(np.array([[*-half, -np.inf], [*half, top]]))
        return corners

    def depths(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a lower bound of the depth of points below the surface, (n,) [m], negative outside.

        Args:
            points: points in the frame of the shape, (n, 3) [m].
        """
        heights = np.asarray(self.heights, dtype=np.float64)
        last = np.array(heights.shape) - 1
        u = points[:, :2] / self.spacing + last / 2
        i, j = np.clip(np.floor(u).astype(np.int64), 0, last - 1).T
        s, t = u.T - (i, j)
        long, short = np.maximum(s, t), np.minimum(s, t)
        side = np.where(s >= t, heights[i + 1, j], heights[i, j + 1])
        ground = (1 - long) * heights[i, j] + (long - short) * side + short * heights[i + 1, j + 1]
        beside = np.abs(points[:, :2]) - last * self.spacing / 2
        depths: NDArray[np.float64] = np.where(
            beside.max(axis=1) > 0.0, -np.inf, self._values()[3] * (ground - points[:, 2])
        )
        return depths

    def surface(self) -> Triangles:
        """Return the triangles of the ground: two per cell, facing up."""
        nx, ny, _ = self.resolution
        i, j = np.indices((nx, ny))
        low = self.bounds[0]
        x, y = low[0] + i * self.spacing, low[1] + j * self.spacing
        vertices = np.stack([x, y, np.asarray(self.heights)], axis=-1).reshape(-1, 3)
        near = (i * ny + j)[:-1, :-1].reshape(-1)
        far = near + ny + 1
        triangles = np.stack([near, near + ny, far, near, far, near + 1], axis=-1).reshape(-1, 3)
        return vertices, triangles.astype(np.int32)
