"""Clip many convex polygons in space at once (Sutherland and Hodgman 1974)."""

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
        corners: (N, c, 3), corners of each polygon. Only the first `count` corners are valid.
        labels: (N, c), label of the side from each corner to the next.
        count: (N,), number of corners, 0 for an empty polygon.
    """

    corners: FloatArray
    labels: Ints
    count: Ints

    def __getitem__(self, rows: NDArray[np.generic]) -> Polygons:
        return Polygons(self.corners[rows], self.labels[rows], self.count[rows])

    def next_corner(self) -> Ints:
        """Return the index of the next corner after each corner, (N, c)."""
        index = np.arange(self.corners.shape[1])
        return np.where(index + 1 < self.count[:, None], index + 1, 0)

    def area_vectors(self) -> FloatArray:
        """Return the area vectors, (N, 3), right-handed with respect to the order of the corners."""
        is_corner = np.arange(self.corners.shape[1]) < self.count[:, None]
        first = self.corners[:, :1]
        offsets = np.where(is_corner[..., None], self.corners - first, 0.0)
        following = np.take_along_axis(offsets, self.next_corner()[..., None], axis=1)
        return np.asarray(0.5 * np.cross(offsets, following).sum(axis=1))

    def clip(
        self, normal: FloatArray, offset: FloatArray, label: Ints | int, rows: NDArray[np.bool_]
    ) -> None:
        """Clip polygons to the half-spaces normal.x <= offset.

        Args:
            normal: (N, 3), not necessarily of unit length.
            offset: (N,).
            label: label of the new side, one number or (N,).
            rows: True for the polygons to clip, (N,).
        """
        width = self.corners.shape[1]
        index = np.arange(width)
        is_corner = index < self.count[:, None]
        height = np.einsum("nca,na->nc", self.corners, normal) - offset[:, None]
        is_cut = rows & ((height > 0) & is_corner).any(axis=1)
        if not is_cut.any():
            return
        part, height, is_corner = self[is_cut], height[is_cut], is_corner[is_cut]
        after = part.next_corner()
        next_height = np.take_along_axis(height, after, axis=1)
        inside, next_inside = height <= 0, next_height <= 0
        crossing = is_corner & (inside != next_inside)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.where(crossing, height / (height - next_height), 0.0)
        following = np.take_along_axis(part.corners, after[..., None], axis=1)
        crossed = part.corners + t[..., None] * (following - part.corners)

        # Each corner adds itself if it is inside, then the point at which its side crosses the plane.
        kept = np.stack([is_corner & inside, crossing], axis=2).reshape(len(part.count), -1)
        corners = np.stack([part.corners, crossed], axis=2).reshape(len(part.count), -1, 3)
        new = np.broadcast_to(np.asarray(label), (len(rows),))[is_cut][:, None]
        labels = np.stack([part.labels, np.where(inside, new, part.labels)], axis=2)
        labels = labels.reshape(len(part.count), -1)
        order = np.argsort(~kept, axis=1, kind="stable")
        count = kept.sum(axis=1)
        count[count < 3] = 0
        new_width = max(width, int(count.max()))
        if new_width > width:
            self.corners = np.pad(self.corners, ((0, 0), (0, new_width - width), (0, 0)))
            self.labels = np.pad(self.labels, ((0, 0), (0, new_width - width)))
        order = order[:, :new_width]
        self.corners[is_cut, : order.shape[1]] = np.take_along_axis(corners, order[..., None], axis=1)
        self.labels[is_cut, : order.shape[1]] = np.take_along_axis(labels, order, axis=1)
        self.count[is_cut] = count
