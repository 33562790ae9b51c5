"""Meshes of rods: cables, hoses, wires and coil springs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from taichi_soft.core.checks import as_count, as_flag, as_positive
from taichi_soft.core.errors import MeshError
from taichi_soft.core.serialisation import serialised
from taichi_soft.meshing.arrays import FloatArray, as_points
from taichi_soft.meshing.body_mesh import BodyMesh

SHARPEST = -0.9
"""Smallest cosine of the angle between two successive edges at rest: about 154 degrees. Sharper corners are
close to a reversal, whose direction of bending is undefined."""


@serialised("vertices", "closed")
class RodMesh(BodyMesh):
    """Mesh of a rod: a chain of vertices along its axis. It is immutable.

    The shape of the mesh is the shape at rest, straight or curved, so a helix makes a coil spring.

    Args:
        vertices: (n, 3) positions along the axis at rest [m], from one end to the other.
        closed: True joins the last vertex to the first one, which makes a ring.

    Raises: MeshError for wrong shapes or dtypes, numbers that are not finite, fewer than 2 vertices (3 for a
        ring), two successive vertices at the same position, or a corner that turns back by more than 154
        degrees.

    Attributes:
        edges: int32 (k, 2), edge i joins vertices i and i + 1. The last edge of a ring joins vertices 0 and
            n - 1.
        closed: True for a ring.

    The arrays are copied. `tets` is empty, (0, 4), and so is `surface`, (0, 3).
    Example:
        turn = np.linspace(0, 12 * np.pi, 145)
        coil = RodMesh(np.stack([0.05 * np.cos(turn), 0.05 * np.sin(turn), 0.005 * turn], axis=1))
    """

    closed: bool

    def __init__(self, vertices: ArrayLike, *, closed: bool = False) -> None:
        points, is_ring = as_points(vertices), as_flag(closed, "closed")
        least = 3 if is_ring else 2
        if len(points) < least:
            raise MeshError(f"a {'ring' if is_ring else 'rod'} needs {least} vertices, got {len(points)}")
        first = np.arange(len(points) if is_ring else len(points) - 1)
        following = (first + 1) % len(points)
        along = points[following] - points[first]
        squares = (along**2).sum(axis=1)
        if not (squares > 0.0).all():
            row = int(np.argmin(squares))
            raise MeshError(
                f"vertices {row} and {following[row]} are at the same position: remove one, or move it"
            )
        before = along if is_ring else along[1:]
        cosines = (np.roll(along, 1, axis=0)[-len(before) :] * before).sum(axis=1)
        lengths = np.sqrt(squares)
        cosines /= (np.roll(lengths, 1) * lengths)[-len(before) :] if len(before) else 1.0
        if len(before) and cosines.min() < SHARPEST:
            corner = int(np.argmin(cosines)) + (0 if is_ring else 1)
            raise MeshError(f"the rod turns back at vertex {corner}: round the corner off with more vertices")
        edges = np.sort(np.stack([first, following], axis=1), axis=1).astype(np.int32)
        super().__init__(points, edges, np.zeros((0, 4), dtype=np.int32))
        empty = np.zeros((0, 3), dtype=np.int32)
        empty.flags.writeable = False
        self.__dict__.update(closed=is_ring, surface=empty)

    def __repr__(self) -> str:
        return f"RodMesh({len(self.vertices)} vertices{', closed' if self.closed else ''})"

    def __reduce__(self) -> tuple[Any, ...]:
        # Copying and unpickling rebuild the mesh, so that its arrays are read-only again.
        return (_rebuilt, (self.vertices, self.closed))

    def _with_vertices(self, vertices: FloatArray) -> RodMesh:
        return RodMesh(vertices, closed=self.closed)


def _rebuilt(vertices: FloatArray, closed: bool) -> RodMesh:
    return RodMesh(vertices, closed=closed)


def rod(length: float, segments: int) -> RodMesh:
    """Make a straight rod along x, centred at the origin. Vertex 0 is the end at the lowest x.

    Args:
        length: total length [m].
        segments: number of edges.
    Raises: OptionError for a number out of range.
    Example:
        hose = rod(length=2.0, segments=40)
    """
    count = as_count(segments, "segments")
    x = (np.arange(count + 1) - count / 2) * (as_positive(length, "length", "m") / count)
    return RodMesh(np.stack([x, 0.0 * x, 0.0 * x], axis=1))
