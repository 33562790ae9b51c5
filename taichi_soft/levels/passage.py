"""How a deformation passes from one mesh of a thing to another one of the same thing."""

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
    """From the vertices of one level of detail to those of another.

    Linear; right for rigid motion, and to second order as a skin is: see `bodies.skin`.
    """

    def __init__(self, source: SoftBodyAsset, target: SoftBodyAsset) -> None:
        """Find where the one lies in the other, at rest."""
        mesh, aims = source.mesh, target.mesh.vertices
        assert isinstance(mesh, TetMesh)
        tets, shares = Locator(mesh)(aims)
        corners = mesh.tets[tets]
        held = (shares[:, :, None] * mesh.vertices[corners]).sum(axis=1)
        arms = (2.0 * aims - held)[:, None] - mesh.vertices[corners]
        self._sources, self._begins, self._weights = _weights(mesh, corners, shares, 0.5 * arms)
        self.places = source.mesh.vertices, aims  # of both, at rest

    def __call__(self, rows: Floats) -> Floats:
        """Positions, velocities or other quantities (n, q) of the source's vertices, for those of the target,
        (k, q)."""
        return np.add.reduceat(rows[self._sources] * self._weights[:, None], self._begins, axis=0)

    @property
    def rows(self) -> dict[str, NDArray[Any]]:
        """Which vertices of the source each one of the target is made of, and with what weights: its own
        begin at `begins`."""
        return {
            "sources": self._sources.astype(np.int32),
            "begins": self._begins.astype(np.int32),
            "weights": self._weights,
        }

    def nearest(self, vertices: Ints) -> Ints:
        """Vertices of the target that are nearest to some of the source, at rest."""
        source, target = self.places
        apart = ((source[vertices, None] - target) ** 2).sum(axis=2)
        return np.asarray(apart.argmin(axis=1))

    def nearest_sources(self, targets: Ints, sources: Ints) -> Ints:
        """Which of some vertices of the source is nearest to each of some of the target, at rest."""
        source, target = self.places
        apart = ((target[targets, None] - source[sources]) ** 2).sum(axis=2)
        return np.asarray(apart.argmin(axis=1))


def _weights(
    mesh: TetMesh, corners: NDArray[np.int32], shares: Floats, arms: Floats
) -> tuple[Ints, Ints, Floats]:
    """Of the sum that each of k vertices is: vertices of the mesh (e,), where those of each begin (k,), and
    their weights (e,).

    A corner has its share (k, 4), and passes on its gradient along its arm (k, 4, 3): what its neighbours
    differ from it, by `gradient_rows`.
    """
    neighbours, first, slopes = gradient_rows(mesh)
    n, corner = len(mesh.vertices), corners.ravel().astype(np.int64)
    counts = np.diff(first)[corner]
    pair = np.repeat(np.arange(len(corner)), counts)  # a corner of an aim, and a neighbour of that
    place = np.arange(len(pair)) - np.repeat(np.cumsum(counts) - counts, counts) + first[corner[pair]]
    along = (slopes[place] * (shares[:, :, None] * arms).reshape(-1, 3)[pair]).sum(axis=1)
    own = shares.ravel() - np.bincount(pair, along, len(corner))
    aim = np.repeat(np.arange(len(corners)), 4)
    keys, entry = np.unique(
        np.concatenate([aim * n + corner, aim[pair] * n + neighbours[place]]), return_inverse=True
    )
    begins = np.searchsorted(keys, np.arange(len(corners)) * n)
    weights = np.bincount(entry, np.concatenate([own, along]))
    return np.asarray(keys % n, np.int64), np.asarray(begins, np.int64), np.asarray(weights, np.float64)


_known: weakref.WeakKeyDictionary[SoftBodyAsset, dict[tuple[int, int], Passage]] = weakref.WeakKeyDictionary()


def passage(asset: SoftBodyAsset, source: int, target: int) -> Passage:
    """From a level of detail of an asset to another: made where it is wanted first."""
    of_asset = _known.setdefault(asset, {})
    if (source, target) not in of_asset:
        of_asset[source, target] = Passage(asset.levels[source], asset.levels[target])
    return of_asset[source, target]


def prepare(asset: SoftBodyAsset) -> None:
    """Make all that a change of level takes, and that is slow to make: a tenth of a second and more."""
    for source in range(len(asset.levels)):
        for target in range(len(asset.levels)):
            if source != target:
                passage(asset, source, target)
    for each in asset.coarser:
        _ = each.arrays, each.surface_row, each.first_frequency
