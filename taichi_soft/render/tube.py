"""Tubes to draw: ropes, cables and other bodies that consist of edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.render.colors import PALETTE
from taichi_soft.render.drawn_surface import Surface
from taichi_soft.render.look import Look, LookName

SIDES = 10
"""Number of sides of a tube."""

SHARPEST = 0.5
"""Smallest cosine of the angle between an edge and the normal of the section that it shares with the next
edge. At sharper corners the tubes of the two edges overlap."""

Floats = NDArray[np.float64]


class Tube(Surface):
    """Surface around the edges of a body: a prism per edge. At a corner, two prisms share one section.

    Args:
        positions: positions of all vertices of the body, (n, 3) [m]. Set them before each frame.
        edges: vertices at the ends of each edge, (k, 2).
        radius: radius of the tube [m].
        color: sRGB from 0 to 1, (3,) or one per vertex (n, 3).
        look: "matte" or "jelly".
    Raises: as `Surface`.
    """

    def __init__(
        self,
        positions: ArrayLike,
        edges: NDArray[np.integer],
        radius: float,
        *,
        color: ArrayLike = PALETTE[0],
        look: Look | LookName = Look.MATTE,
    ) -> None:
        self._edges, self._radius = np.asarray(edges), radius
        around = np.arange(SIDES)
        behind, ahead, following = around, around + SIDES, (around + 1) % SIDES
        sides = np.concatenate(
            [
                np.stack([behind, following, ahead], axis=1),
                np.stack([following, following + SIDES, ahead], axis=1),
            ]
        )
        fan = np.stack([np.zeros(SIDES - 2, dtype=int), around[1:-1], around[2:]], axis=1)
        prism = np.concatenate([sides, fan[:, ::-1], fan + SIDES])
        first = 2 * SIDES * np.arange(len(self._edges))
        super().__init__(positions, (first[:, None, None] + prism).reshape(-1, 3), color=color, look=look)

    def spread(self, rows: NDArray[np.floating]) -> NDArray[np.floating]:
        """Return the positions of the prisms' vertices [m].

        Args: rows: positions of the body's vertices, (n, 3) [m].
        """
        x = rows.astype(np.float64)
        starts, ends = self._edges[:, 0], self._edges[:, 1]
        along = x[ends] - x[starts]
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-30)
        sums, counts = np.zeros_like(x), np.bincount(self._edges.ravel(), minlength=len(x))
        np.add.at(sums, starts, along)
        np.add.at(sums, ends, along)
        flattest = np.abs(along).argmin(axis=1)
        u = np.cross(along, np.eye(3)[flattest])
        u /= np.maximum(np.linalg.norm(u, axis=1, keepdims=True), 1e-30)
        w = np.cross(along, u)
        angles = 2.0 * np.pi * np.arange(SIDES) / SIDES
        circle = self._radius * (np.cos(angles)[:, None] * u[:, None] + np.sin(angles)[:, None] * w[:, None])
        rings = [self._section(x, side, along, circle, sums, counts) for side in (starts, ends)]
        return np.concatenate(rings, axis=1).reshape(-1, 3)

    @staticmethod
    def _section(
        x: Floats,
        vertices: NDArray[np.integer],
        along: Floats,
        circle: Floats,
        sums: Floats,
        counts: NDArray[np.integer],
    ) -> Floats:
        """Return the section of each edge at one of its ends, (k, SIDES, 3) [m].

        Where two edges meet, the section lies in the plane between them.
        """
        normal = sums[vertices] / np.maximum(np.linalg.norm(sums[vertices], axis=1, keepdims=True), 1e-30)
        cosine = (normal * along).sum(axis=1)
        is_shared = (counts[vertices] == 2) & (cosine > SHARPEST)
        slope = (circle @ normal[:, :, None])[:, :, 0] / np.where(is_shared, cosine, 1.0)[:, None]
        shift = np.where(is_shared[:, None], slope, 0.0)[:, :, None] * along[:, None]
        section: Floats = x[vertices][:, None] + circle - shift
        return section

    def spread_colors(self, rows: NDArray[np.floating]) -> NDArray[np.floating]:
        """Return the colours of the prisms' vertices, sRGB.

        Args: rows: colours of the body's vertices, (n, 3).
        """
        return np.repeat(rows[self._edges].reshape(-1, 3), SIDES, axis=0)
