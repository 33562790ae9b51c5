"""An artist's mesh that a body carries: bound to its tetrahedra once, drawn where they are in every frame.

A vertex of the skin lies at shares s of the four vertices of a tetrahedron. Each of these, i, has a gradient
F_i of the deformation, the mean over the tetrahedra round it, and tells where it would put the vertex:

    x = sum_i s_i (x_i + F_i (q - X_i) / 2)

with q the vertex at rest. The sum of s_i x_i alone is linear in each tetrahedron and has creases at their
faces. With half of what the gradients say it is right for every deformation of second order where the F_i
are. Normals turn by the mean of the F_i, which is continuous, so that no face is seen in the shading.

A vertex outside of the cage is bound to the nearest point p of it, and carried along by the mean of the F_i:
then q is 2 X - p, which puts it into the same sum.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.kernels.skin import in_lanes
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
    """A surface bound to the tetrahedra of a mesh: what all bodies of an asset share."""

    surface: Surface
    tets: Ints32  # (k,), of the mesh, that holds each vertex or is nearest
    shares: Floats  # (k, 4), of that tetrahedron's vertices
    ints: Ints32  # see `write_skin`
    floats: Floats32

    @property
    def vertex_count(self) -> int:
        """Number of its vertices, k."""
        return len(self.tets)


def bound(mesh: TetMesh, surfaces: tuple[Surface, ...]) -> tuple[Skin, ...]:
    """Surfaces bound to a mesh at rest."""
    locator = Locator(mesh)
    neighbours, begins, slopes = slopes_of(mesh)
    skins = []
    for surface in surfaces:
        tets, shares = locator(surface.vertices)
        corners = mesh.tets[tets]
        inside = (shares[:, :, None] * mesh.vertices[corners]).sum(axis=1)
        aims = 2.0 * surface.vertices - inside
        ints = np.concatenate([begins, neighbours, in_lanes(corners)]).astype(np.int32)
        rows_of_each = np.concatenate([shares, aims, surface.normals], axis=1)
        floats = [slopes, mesh.vertices, in_lanes(rows_of_each)]
        rows = np.concatenate([part.ravel() for part in floats]).astype(np.float32)
        skins.append(Skin(surface, tets.astype(np.int32), shares, read_only(ints), read_only(rows)))
    return tuple(skins)


def slopes_of(mesh: TetMesh) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats]:
    """F of vertex i is the sum over its neighbours j of (x_j - x_i) times their row: neighbours (e,), where
    those of each vertex begin (n + 1,), and rows (e, 3) [1/m]."""
    inverses, n = edge_inverses(mesh.vertices[mesh.tets]), len(mesh.vertices)
    gradients = np.concatenate([-inverses.sum(axis=1, keepdims=True), inverses], axis=1)
    weights = mesh.volumes
    round_each = np.bincount(mesh.tets.ravel(), np.repeat(weights, 4), n)
    own = np.repeat(mesh.tets, 4, axis=1).ravel().astype(np.int64)
    other = np.tile(mesh.tets, (1, 4)).ravel()
    rows = np.tile(gradients * weights[:, None, None], (1, 4, 1)).reshape(-1, 3)
    keys, place = np.unique(own * n + other, return_inverse=True)
    sums = [np.bincount(place.reshape(-1), rows[:, k], len(keys)) for k in range(3)]
    first, second = keys // n, keys % n
    slopes = np.stack(sums, axis=1) / round_each[first][:, None]
    apart = first != second
    begins = np.searchsorted(first[apart], np.arange(n + 1))
    return second[apart], begins, slopes[apart]
