"""Linear maps of deformations between two meshes of the same body."""

from __future__ import annotations

import weakref
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.bodies.skin import gradient_rows
from taichi_soft.meshing import TetMesh
from taichi_soft.meshing.locating import Locator

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Passage:
    """Map of deformations from one level of detail to another.

    The map is linear, exact for rigid motions and accurate to second order, like a skin: see `bodies.skin`.
    """

    def __init__(self, source: SoftBodyAsset, target: SoftBodyAsset) -> None:
        """Locate the target's vertices in the source's tetrahedra, at rest."""
        mesh, targets = source.mesh, target.mesh.vertices
        assert isinstance(mesh, TetMesh)
        tets, coordinates = Locator(mesh)(targets)
        corners = mesh.tets[tets]
        interpolated = (coordinates[:, :, None] * mesh.vertices[corners]).sum(axis=1)
        offsets = (2.0 * targets - interpolated)[:, None] - mesh.vertices[corners]
        sources, begins, weights = _weights(mesh, corners, coordinates, 0.5 * offsets)
        self.vertices = source.mesh.vertices, targets  # source and target vertices at rest [m]
        # Source vertices and weights. The entries of target vertex i start at row `begins[i]`.
        self.rows: dict[str, NDArray[Any]] = {
            "sources": sources.astype(np.int32),
            "begins": begins.astype(np.int32),
            "weights": weights,
        }

    def nearest(self, vertices: Ints) -> Ints:
        """Return the nearest target vertex of each source vertex in `vertices`, at rest."""
        source, target = self.vertices
        squared_distances = ((source[vertices, None] - target) ** 2).sum(axis=2)
        return np.asarray(squared_distances.argmin(axis=1))

    def nearest_sources(self, targets: Ints, sources: Ints) -> Ints:
        """Return for each target vertex in `targets` the row in `sources` of the nearest vertex, at rest."""
        source, target = self.vertices
        squared_distances = ((target[targets, None] - source[sources]) ** 2).sum(axis=2)
        return np.asarray(squared_distances.argmin(axis=1))


def _weights(
    mesh: TetMesh, corners: NDArray[np.int32], coordinates: Floats, offsets: Floats
) -> tuple[Ints, Ints, Floats]:
    """Return source vertices (e,), the first row of each of the k target vertices (k,), and weights (e,).

    Each corner of the source tetrahedron contributes its barycentric coordinate. It also contributes its
    gradient from `gradient_rows`, multiplied by the offset.

    Args: coordinates: (k, 4) barycentric coordinates. offsets: (k, 4, 3) offsets from the corners [m].
    """
    neighbours, first, gradients = gradient_rows(mesh)
    n, corner = len(mesh.vertices), corners.ravel().astype(np.int64)
    counts = np.diff(first)[corner]
    pair = np.repeat(np.arange(len(corner)), counts)  # row in `corner` of each pair (corner, neighbour)
    gradient_row = np.arange(len(pair)) - np.repeat(np.cumsum(counts) - counts, counts) + first[corner[pair]]
    along = (gradients[gradient_row] * (coordinates[:, :, None] * offsets).reshape(-1, 3)[pair]).sum(axis=1)
    own = coordinates.ravel() - np.bincount(pair, along, len(corner))
    target_row = np.repeat(np.arange(len(corners)), 4)
    keys, entry = np.unique(
        np.concatenate([target_row * n + corner, target_row[pair] * n + neighbours[gradient_row]]),
        return_inverse=True,
    )
    begins = np.searchsorted(keys, np.arange(len(corners)) * n)
    weights = np.bincount(entry, np.concatenate([own, along]))
    return np.asarray(keys % n, np.int64), np.asarray(begins, np.int64), np.asarray(weights, np.float64)


_cached: weakref.WeakKeyDictionary[SoftBodyAsset, dict[tuple[int, int], Passage]] = (
    weakref.WeakKeyDictionary()
)


def passage(asset: SoftBodyAsset, source: int, target: int) -> Passage:
    """Return the map from one level of detail of an asset to another, cached after the first call."""
    passages = _cached.setdefault(asset, {})
    if (source, target) not in passages:
        passages[source, target] = Passage(asset.levels[source], asset.levels[target])
    return passages[source, target]


def prepare(asset: SoftBodyAsset) -> None:
    """Create all maps and arrays for changes of level in advance, because creating them is slow."""
    for source in range(len(asset.levels)):
        for target in range(len(asset.levels)):
            if source != target:
                passage(asset, source, target)
    for each in asset.coarser:
        _ = each.arrays, each.surface_row, each.first_frequency
