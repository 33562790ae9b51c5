"""Constants of every edge of a body at rest for a pairwise law, computed in NumPy by the law's file."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.residue import without_residue

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Ring(Enum):
    """Contents of the rows of an edge's ring, and their use while the body deforms."""

    NONE = "none"  # no rows: a spring depends only on its two ends
    EXPANSION = "expansion"  # tetrahedra, whose change of volume pulls or pushes along the edge
    VORONOI = "voronoi"  # corners of the Voronoi face, each in barycentric coordinates of four particles
    SUBFACES = "subfaces"  # the two particles that span a barycentric subface
    PLANE = "plane"  # particles, to which a plane is fitted
    HALVES = "halves"  # particles, whose ring is split into halves twice
    TILT = "tilt"  # particles, whose rise tilts a plane


@dataclass(frozen=True, eq=False)
class Bonds:
    """Constants and ring of every edge of a mesh, in the order and direction of `mesh.edges`.

    Attributes:
        constants: (k, 4): length at rest [m], stiffness along and across the edge [N/m], damping across it
            [N s/m]. Zero if an edge is not a bond. In laws that compare directions, the length is 1 and the
            stiffness in [N]. In laws with expansion, the third column is the area of the edge [m^2].
        ring_edge: (r,) edge of each row of the rings, ascending.
        ring_members: (r, 4) vertices, or tetrahedra in the first column; -1 in unused columns.
        ring_weights: (r, 4), with a meaning that depends on the law.
        normals: (k, 3) unit normal at rest of the plane that separates tension from shear; NaN without one.
        masses: (n,) [kg], if the law distributes mass differently from the mesh; else None.
        expansion_modulus: (m,) [Pa], pressure of each tetrahedron on its edges per dV / V0, or None.
    """

    constants: Floats
    ring_edge: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    ring_members: Ints = field(default_factory=lambda: np.zeros((0, 4), np.int64))
    ring_weights: Floats = field(default_factory=lambda: np.zeros((0, 4)))
    normals: Floats | None = None
    masses: Floats | None = None
    expansion_modulus: Floats | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "ring_weights", without_residue(self.ring_weights, axis=0))

    @property
    def is_bond(self) -> NDArray[np.bool_]:
        """True for edges that carry force, (k,)."""
        return np.asarray(self.constants[:, 1] > 0)


def columns(*values: Floats | float, count: int) -> Floats:
    """Stack the given columns, padded with zeros on the right, (count, 4)."""
    rows = np.zeros((count, 4))
    for i, value in enumerate(values):
        rows[:, i] = value
    return rows


def member_columns(*values: Ints, count: int) -> Ints:
    """Stack the given columns, padded with -1 on the right, (count, 4)."""
    rows = np.full((count, 4), -1, dtype=np.int64)
    for i, value in enumerate(values):
        rows[:, i] = value
    return rows
