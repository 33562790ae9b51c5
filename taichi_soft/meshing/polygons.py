"""Many convex polygons in space at once, cut by planes (Sutherland and Hodgman 1974)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.meshing.arrays import FloatArray

Ints = NDArray[np.int64]


@dataclass
class Polygons:
    """N convex polygons with up to c corners each.

    Attributes:
        corners: (N, c, 3), of which the first `count` are there.
        labels: (N, c), what made the side from each corner to the next.
        count: (N,), 0 where nothing is left.
    """

    corners: FloatArray
    labels: Ints
    count: Ints

    def __getitem__(self, rows: NDArray[np.generic]) -> Polygons:
        return Polygons(self.corners[rows], self.labels[rows], self.count[rows])

    def next_corner(self) -> Ints:
        """Index of the corner after each, (N, c)."""
        number = np.arange(self.corners.shape[1])
        return np.where(number + 1 < self.count[:, None], number + 1, 0)

    def area_vectors(self) -> FloatArray:
        """(N, 3), right-handed about the order of corners."""
        there = np.arange(self.corners.shape[1]) < self.count[:, None]
        first = self.corners[:, :1]
        arms = np.where(there[..., None], self.corners - first, 0.0)
        following = np.take_along_axis(arms, self.next_corner()[..., None], axis=1)
        return np.asarray(0.5 * np.cross(arms, following).sum(axis=1))

    def cut(self, normal: FloatArray, offset: FloatArray, label: Ints | int, rows: NDArray[np.bool_]) -> None:
        """Keep of each polygon in `rows` what lies where normal.x <= offset; the new side gets `label`.

        Args:
            normal: (N, 3), not necessarily of unit length.
            offset: (N,).
        """
        width = self.corners.shape[1]
        number = np.arange(width)
        there = number < self.count[:, None]
        height = np.einsum("nca,na->nc", self.corners, normal) - offset[:, None]
        touched = rows & ((height > 0) & there).any(axis=1)
        if not touched.any():
            return
        part, height, there = self[touched], height[touched], there[touched]
        after = part.next_corner()
        next_height = np.take_along_axis(height, after, axis=1)
        inside, next_inside = height <= 0, next_height <= 0
        crossing = there & (inside != next_inside)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.where(crossing, height / (height - next_height), 0.0)
        following = np.take_along_axis(part.corners, after[..., None], axis=1)
        crossed = part.corners + t[..., None] * (following - part.corners)

        # Every corner gives itself where it is inside, then the point where its side crosses the plane.
        kept = np.stack([there & inside, crossing], axis=2).reshape(len(part.count), -1)
        corners = np.stack([part.corners, crossed], axis=2).reshape(len(part.count), -1, 3)
        new = np.broadcast_to(np.asarray(label), (len(rows),))[touched][:, None]
        labels = np.stack([part.labels, np.where(inside, new, part.labels)], axis=2)
        labels = labels.reshape(len(part.count), -1)
        order = np.argsort(~kept, axis=1, kind="stable")
        count = kept.sum(axis=1)
        count[count < 3] = 0
        room = max(width, int(count.max()))
        if room > width:
            self.corners = np.pad(self.corners, ((0, 0), (0, room - width), (0, 0)))
            self.labels = np.pad(self.labels, ((0, 0), (0, room - width)))
        order = order[:, :room]
        self.corners[touched, : order.shape[1]] = np.take_along_axis(corners, order[..., None], axis=1)
        self.labels[touched, : order.shape[1]] = np.take_along_axis(labels, order, axis=1)
        self.count[touched] = count
