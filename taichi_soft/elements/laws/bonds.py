"""Constants of the edges of a body at rest for pairwise laws. The file of each law computes them in NumPy."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.residue import without_residue

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Ring(Enum):
    """Contents of the rows in the ring of an edge. The laws read these rows while the body deforms."""

    NONE = "none"  # no rows: a spring depends only on its two ends
    EXPANSION = "expansion"  # tetrahedra, whose change of volume pulls or pushes along the edge
    VORONOI = "voronoi"  # corners of the Voronoi face, in barycentric coordinates of four particles
    SUBFACES = "subfaces"  # the two particles that span a barycentric subface
    PLANE = "plane"  # particles around the edge, to which a plane is fitted
    HALVES = "halves"  # particles around the edge; their ring is split into halves twice
    TILT = "tilt"  # particles around the edge; their displacement along the edge tilts a plane


@dataclass(frozen=True, eq=False)
class Bonds:
    """Constants and ring of every edge of a mesh, in the order and direction of `mesh.edges`.

    Attributes:
        constants: (k, 4): length at rest [m], stiffness along and across the edge [N/m], damping across the
            edge [N s/m]. All are zero if an edge is not a bond. In laws that compare directions, the length
            is 1 and the unit of stiffness is [N]. In laws with expansion, the third column is the area of the
            edge [m^2].
        ring_edge: (r,) edge to which each ring row belongs, in ascending order.
        ring_members: (r, 4) vertices, or tetrahedra in the first column; -1 in unused columns.
        ring_weights: (r, 4), with a meaning that depends on the law.
        normals: (k, 3) unit normal at rest of the plane that separates tension from shear; NaN for an edge
            without a plane; None for laws without planes.
        masses: (n,) mass of each particle [kg], if the law distributes mass differently from the mesh; else
            None.
        expansion_modulus: (m,) pressure of each tetrahedron on its edges per dV / V0 [Pa]; None for laws
            without expansion.
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
    """Return an array, (count, 4), whose first columns are `values`. The other columns are zero."""
    rows = np.zeros((count, 4))
    for i, value in enumerate(values):
        rows[:, i] = value
    return rows


def member_columns(*values: Ints, count: int) -> Ints:
    """Return an array, (count, 4), whose first columns are `values`. The other columns are -1."""
    rows = np.full((count, 4), -1, dtype=np.int64)
    for i, value in enumerate(values):
        rows[:, i] = value
    return rows
