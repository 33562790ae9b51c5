"""Find the strain that a law of chapter 4 computes for an edge, from the stiffness of the edge.

If one end of an edge moves, the force at the other end changes. Per metre, the change is a E / l along the
law's direction of tension, and a G / l perpendicular to this direction, with the face area a and the edge
length l. The eigenvectors of this stiffness matrix give the direction of tension.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft import Material, TetMesh, force_gradient
from taichi_soft.core.types import LawName

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class EdgeReading:
    """Direction of tension and stiffness of an edge in a deformed body."""

    normal: Floats  # the law's direction of tension, unit vector
    tension_stiffness: float  # stiffness in tension, a E / l [N/m]
    shear_stiffness: float  # stiffness in shear, a G / l [N/m]


def read_edge(mesh: TetMesh, material: Material, positions: Floats, law: LawName) -> EdgeReading:
    """Return the direction of tension and the stiffness of the edge between vertices 0 and 1.

    Args:
        positions: positions of all vertices, (n, 3) [m].
    """
    block = force_gradient(mesh, material, positions, law=law)[0, :, 1, :]
    values, vectors = np.linalg.eigh((block + block.T) / 2)
    normal = vectors[:, 2]  # the largest eigenvalue, because E > G
    if normal @ (positions[1] - positions[0]) < 0:
        normal = -normal
    return EdgeReading(normal, float(values[2]), float(values[0]))


def strains(vector: Floats, normal: Floats) -> tuple[float, float]:
    """Return the tensile and the shear strain (eq. 4.3) of an edge.

    Args:
        vector: the deformed edge, (3,). At rest, the edge has length 1 and lies along the direction of
            tension.
        normal: direction of tension in the deformed body, a unit vector.
    """
    stretch = float(normal @ vector)
    return stretch - 1, float(np.linalg.norm(vector - stretch * normal))


def ringed_edge(count: int, radius: float = 1.0) -> TetMesh:
    """Make a mesh of an edge of length 1 along z and `count` vertices spread evenly around its centre.

    The edge joins vertices 0 and 1.
    """
    turn = 2 * np.pi * np.arange(count) / count
    return edge_in_ring(radius * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1))


def edge_in_ring(ring: Floats) -> TetMesh:
    """Make a mesh of an edge of length 1 along z and a counterclockwise ring of vertices (n, 3) around it."""
    count = len(ring)
    ends = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]])
    tets = [[0, 1, 2 + i, 2 + (i + 1) % count] for i in range(count)]
    return TetMesh(np.concatenate([ends, ring]), np.array(tets), fix_orientation=True)
