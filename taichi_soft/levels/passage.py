"""How a deformation passes from one mesh of a thing to another one of the same thing."""

from __future__ import annotations

import weakref

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.bodies.skin import slopes_of
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
        tets, self._shares = Locator(mesh)(aims)
        self._corners = mesh.tets[tets]
        self._neighbours, begins, self._slopes = slopes_of(mesh)
        self._owners, self._begins = np.repeat(np.arange(len(begins) - 1), np.diff(begins)), begins[:-1]
        held = np.einsum("kc,kcx->kx", self._shares, mesh.vertices[self._corners])
        self._arms = (2.0 * aims - held)[:, None] - mesh.vertices[self._corners]
        self.places = source.mesh.vertices, aims  # of both, at rest

    def __call__(self, rows: Floats) -> Floats:
        """Positions, velocities or other quantities (n, q) of the source's vertices, for those of the target,
        (k, q)."""
        differences = rows[self._neighbours] - rows[self._owners]
        gradients = np.add.reduceat(differences[:, :, None] * self._slopes[:, None], self._begins, axis=0)
        pulled = np.einsum("kcqy,kcy->kcq", gradients[self._corners], self._arms)
        return np.asarray(np.einsum("kc,kcq->kq", self._shares, rows[self._corners] + 0.5 * pulled))

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


_known: weakref.WeakKeyDictionary[SoftBodyAsset, dict[tuple[int, int], Passage]] = weakref.WeakKeyDictionary()


def passage(asset: SoftBodyAsset, source: int, target: int) -> Passage:
    """From a level of detail of an asset to another: made where it is wanted first."""
    of_asset = _known.setdefault(asset, {})
    if (source, target) not in of_asset:
        of_asset[source, target] = Passage(asset.levels[source], asset.levels[target])
    return of_asset[source, target]


def prepare_passages(asset: SoftBodyAsset) -> None:
    """Make all that an asset has: each takes a tenth of a second to some, too long within a frame."""
    count = len(asset.levels)
    for source in range(count):
        for target in range(count):
            if source != target:
                passage(asset, source, target)
