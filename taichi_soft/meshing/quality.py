"""Shape quality of the tetrahedra of a mesh. Small angles make a simulation stiff and fragile."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from taichi_soft.meshing.arrays import FloatArray, IntArray, read_only
from taichi_soft.meshing.topology import LOCAL_EDGES, LOCAL_FACES

# Smallest valid volume of a tetrahedron, divided by the cube of its longest edge (0.118 for a regular
# tetrahedron). A flatter tetrahedron would degenerate in the float32 numbers of the simulation (rounding
# 1.2e-7).
FLATTEST = 1e-7


@dataclass(frozen=True, eq=False)
class MeshQuality:
    """Shape measures of every tetrahedron.

    Attributes:
        min_dihedral: float64 (m,), smallest of the six angles between faces [degrees]. It is 70.53 for a
            regular tetrahedron.
        max_dihedral: float64 (m,), largest of the six angles between faces [degrees].
        aspect_ratio: float64 (m,), 3 * inradius / circumradius. It is 1 for a regular tetrahedron and close
            to 0 for a flat tetrahedron.
        shortest_edge: shortest edge of the mesh [m].
        longest_edge: longest edge of the mesh [m].
    """

    min_dihedral: FloatArray
    max_dihedral: FloatArray
    aspect_ratio: FloatArray
    shortest_edge: float
    longest_edge: float

    def summary(self) -> str:
        """Summarise the worst values in one line, for logs and reports."""
        return (
            f"dihedral angles {self.min_dihedral.min():.1f} to {self.max_dihedral.max():.1f} deg, "
            f"aspect ratio {self.aspect_ratio.min():.3f} to {self.aspect_ratio.max():.3f}, "
            f"edges {self.shortest_edge:.4g} to {self.longest_edge:.4g} m"
        )


def measure_quality(vertices: FloatArray, tets: IntArray) -> MeshQuality:
    """Measure the shapes of tetrahedra.

    Args:
        vertices: (n, 3) [m].
        tets: (m, 4), with positive volumes.
    """
    corners = vertices[tets]
    a, b, c = (corners[:, i] - corners[:, 0] for i in (1, 2, 3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0

    faces = corners[:, LOCAL_FACES]
    area_vectors = 0.5 * np.cross(faces[:, :, 1] - faces[:, :, 0], faces[:, :, 2] - faces[:, :, 0])
    areas = np.linalg.norm(area_vectors, axis=2)
    # Faces i and j (opposite vertices i and j) enclose pi minus the angle between their outward normals.
    first, second = area_vectors[:, LOCAL_EDGES[:, 0]], area_vectors[:, LOCAL_EDGES[:, 1]]
    cosine = -np.einsum("tej,tej->te", first, second)
    dihedral = np.degrees(np.arctan2(np.linalg.norm(np.cross(first, second), axis=2), cosine))

    def squared(x: FloatArray) -> FloatArray:
        squares: FloatArray = np.einsum("ij,ij->i", x, x)
        return squares[:, None]

    towards_centre = squared(a) * np.cross(b, c) + squared(b) * np.cross(c, a) + squared(c) * np.cross(a, b)
    circumradius = np.linalg.norm(towards_centre, axis=1) / (12.0 * volume)
    inradius = 3.0 * volume / areas.sum(axis=1)

    ends = corners[:, LOCAL_EDGES]
    lengths = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    return MeshQuality(
        min_dihedral=read_only(dihedral.min(axis=1)),
        max_dihedral=read_only(dihedral.max(axis=1)),
        aspect_ratio=read_only(3.0 * inradius / circumradius),
        shortest_edge=float(lengths.min()),
        longest_edge=float(lengths.max()),
    )
