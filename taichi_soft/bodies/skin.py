"""Skin: an artist's mesh that is bound to the tetrahedra of a body once, and follows them in every frame.

A skin vertex has a weight s_i for each of the four vertices i of a tetrahedron. Each vertex i has a
deformation gradient F_i, the mean over the tetrahedra around the vertex. The position of the skin vertex is

    x = sum_i s_i (x_i + F_i (q - X_i) / 2)

where q is the position of the skin vertex at rest. The sum of s_i x_i alone is linear in each tetrahedron and
has creases at the faces. The second term, with the factor 1/2, makes the sum exact for every deformation of
second order if the F_i are exact. Normals are transformed by the mean sum_i s_i F_i. This mean is continuous,
so faces are not visible in the shading.

A skin vertex X outside the cage is bound to the nearest point p of the cage. The mean of the F_i transforms
its offset X - p. The result is the same sum with q = 2 X - p.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.kernels.skin import interleaved
from taichi_soft.core.math.barycentric import edge_inverses
from taichi_soft.meshing import TetMesh
from taichi_soft.meshing.arrays import read_only
from taichi_soft.meshing.locating import Locator
from taichi_soft.meshing.surface import Surface

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]
Ints32 = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Skin:
    """Binding of a surface to the tetrahedra of a mesh, shared by all bodies of an asset."""

    surface: Surface
    tets: Ints32  # (k,), tetrahedron of the mesh that contains each vertex, or the nearest tetrahedron
    weights: Floats  # (k, 4), weights of that tetrahedron's vertices
    ints: Ints32  # see `write_skin`
    floats: Floats32  # see `write_skin`

    @property
    def vertex_count(self) -> int:
        """Number of vertices of the surface, k."""
        return len(self.tets)


def bound(mesh: TetMesh, surfaces: tuple[Surface, ...]) -> tuple[Skin, ...]:
    """Bind each surface to a mesh at rest, and return the bindings."""
    locator = Locator(mesh)
    neighbours, begins, slope_rows = gradient_rows(mesh)
    skins = []
    for surface in surfaces:
        tets, weights = locator(surface.vertices)
        corners = mesh.tets[tets]
        inside = (weights[:, :, None] * mesh.vertices[corners]).sum(axis=1)
        targets = 2.0 * surface.vertices - inside
        ints = np.concatenate([begins, neighbours, interleaved(corners)]).astype(np.int32)
        rows_of_each = np.concatenate([weights, targets, surface.normals], axis=1)
        floats = [slope_rows, mesh.vertices, interleaved(rows_of_each)]
        rows = np.concatenate([part.ravel() for part in floats]).astype(np.float32)
        skins.append(Skin(surface, tets.astype(np.int32), weights, read_only(ints), read_only(rows)))
    return tuple(skins)


def gradient_rows(mesh: TetMesh) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats]:
    """Compute rows from which a kernel computes the deformation gradient F of each vertex.

    F of vertex i is the sum over its neighbours j of the outer product of x_j - x_i and the row of j.
    Returns: neighbours of all vertices, (e,); index of the first neighbour of each vertex, followed by e,
        (n + 1,); row of each neighbour, (e, 3) [1/m].
    """
    inverses, n = edge_inverses(mesh.vertices[mesh.tets]), len(mesh.vertices)
    gradients = np.concatenate([-inverses.sum(axis=1, keepdims=True), inverses], axis=1)
    volumes = mesh.volumes
    volume_sums = np.bincount(mesh.tets.ravel(), np.repeat(volumes, 4), n)
    own = np.repeat(mesh.tets, 4, axis=1).ravel().astype(np.int64)
    other = np.tile(mesh.tets, (1, 4)).ravel()
    rows = np.tile(gradients * volumes[:, None, None], (1, 4, 1)).reshape(-1, 3)
    keys, place = np.unique(own * n + other, return_inverse=True)
    sums = [np.bincount(place.reshape(-1), rows[:, k], len(keys)) for k in range(3)]
    first, second = keys // n, keys % n
    slope_rows = np.stack(sums, axis=1) / volume_sums[first][:, None]
    differ = first != second
    begins = np.searchsorted(first[differ], np.arange(n + 1))
    return second[differ], begins, slope_rows[differ]
