"""Remove the few tetrahedra that force small time steps, by flips, collapses and vertex moves.

Each round finds, for every bad tetrahedron, the changes that enlarge the smallest tetrahedron of a cavity.
The round then applies the changes with the largest gains that have no vertex in common. The smallest size in
the mesh therefore never decreases.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.math.barycentric import edge_inverses, shares_by
from taichi_soft.meshing import cavities as cavity
from taichi_soft.meshing import patches
from taichi_soft.meshing.arrays import FloatArray, IntArray
from taichi_soft.meshing.cavities import OUTSIDE, Bools, Cavities, ClosedMesh, Ints
from taichi_soft.meshing.topology import LOCAL_EDGES

SMALL = 0.3
"""Tetrahedra below this fraction of the median size are improved. They need more than three times as many
substeps as a tetrahedron of median size."""

_ROUNDS = 100
_GENTLE_ROUNDS = 3  # number of rounds at the start that use no collapses, so that all vertices stay
_MAX_IDLE_ROUNDS = 6  # the search stops after this number of successive rounds without a change
_MIN_GAIN = 1.02  # a change must enlarge a cavity's smallest size by this factor, so that the rounds end
_VOLUME_TOLERANCE = 0.01  # largest total change of the body's volume, as a fraction of this volume
_MIN_NORMAL_COSINE = 0.77  # smallest cosine between a new surface normal and the nearest old normal
_DRIFT_PENALTY = 0.9  # fraction by which a gain is reduced if the change uses the full surface tolerance
_FLAT = 0.05  # a surface vertex slides along axes with normal moments below this fraction of the largest
_GRADIENT_STEPS = (1.5, 1.0, 0.5, 0.2, 0.05)  # factors of the step that would reach the target size
_RANDOM_STEPS = (
    0.1,
    0.1,
    0.03,
    0.01,
)  # lengths of trial moves in random directions, as fractions of the tetrahedron's extent


class Improved(NamedTuple):
    """Improved mesh: vertices (n, 3) [m], tetrahedra (m, 4), and original of each tetrahedron, (m,)."""

    vertices: FloatArray
    tets: IntArray
    source: IntArray


def improve(
    vertices: FloatArray, tets: IntArray, surface: IntArray, *, size: float | None, tolerance: float
) -> Improved | None:
    """Improve a mesh until its tetrahedra have at least a given size, if possible.

    Args:
        size: smallest size, as `cavities.sizes` defines it [m]; None for `SMALL` times the median.
        tolerance: largest displacement of the surface [m].
    Returns: the improved mesh, or None if nothing can be improved.
    """
    work = _Work(vertices, tets, surface, size, tolerance)
    changed, idle_rounds = False, 0
    for index in range(_ROUNDS):
        improved = work.round(index < _GENTLE_ROUNDS)
        changed |= improved
        idle_rounds = 0 if improved else idle_rounds + 1
        if idle_rounds == _MAX_IDLE_ROUNDS:
            break
    return work.result() if changed else None


class _Work:
    """Mesh that is being improved. A move creates a new vertex, and `result` drops unused vertices."""

    def __init__(
        self, vertices: FloatArray, tets: IntArray, surface: IntArray, size: float | None, tolerance: float
    ) -> None:
        self.tolerance = tolerance
        self.random = np.random.default_rng(0)
        self.x = np.concatenate([np.zeros((1, 3)), vertices])  # row 0: OUTSIDE, without a position
        outer = np.hstack([surface + 1, np.full((len(surface), 1), OUTSIDE)])
        self.tets: Ints = np.concatenate([tets + 1, outer]).astype(np.int64)
        self.source = np.r_[np.arange(len(tets)), np.full(len(surface), -1)]
        self.sizes = cavity.sizes(self.x, self.tets)
        self.target_size = SMALL * float(np.median(self.sizes[: len(tets)])) if size is None else size
        self.origin = np.arange(len(self.x))  # original vertex of each vertex
        self.drift = np.zeros(len(self.tets))  # upper bound of each surface triangle's displacement [m]
        self.keys = self._draw_keys(len(self.x))
        self.budget = _VOLUME_TOLERANCE * float(cavity.volumes(self.x, self.tets).sum())

    def _draw_keys(self, count: int) -> NDArray[np.uint64]:
        return self.random.integers(2**64, size=count, dtype=np.uint64)

    def round(self, gentle: bool) -> bool:
        """Apply one round of changes, without collapses if `gentle`. Returns True if the mesh changed."""
        is_bad = self.sizes < self.target_size
        if not is_bad.any():
            return False
        # A cavity consists of tetrahedra around a corner of a bad tetrahedron. Tests need the next layer too.
        rows = np.flatnonzero(self._touching(self._touching(is_bad)))
        mesh, bad = ClosedMesh(self.tets[rows], self.keys), np.flatnonzero(is_bad[rows])
        edges = np.unique(np.sort(mesh.tets[bad][:, LOCAL_EDGES].reshape(-1, 2), axis=1), axis=0)
        found = [cavity.face_flips(mesh, bad), *cavity.edge_removals(self.x, mesh, edges)]
        found.append(self._moves(mesh, self.sizes[rows], bad))
        if not gentle:
            removed, target = np.concatenate([edges, edges[:, ::-1]]).T
            merged = cavity.collapses(mesh, removed, target)
            better = self._gain(merged.in_rows(rows)) > 0
            better[better] = cavity.meets_link_condition(mesh, removed[better], target[better])
            found.append(merged.kept(better))
        candidates = cavity.joined(found).in_rows(rows)
        gain = self._gain(candidates)
        candidates, gain = candidates.kept(gain > 0), gain[gain > 0]
        drift, fits = self._fits(candidates)
        candidates, gain, drift = candidates.kept(fits), gain[fits], drift[fits]
        # Among changes with similar gains, prefer changes that use less of the surface tolerance.
        worth = gain * (1 - _DRIFT_PENALTY * drift / self.tolerance)
        chosen = self._select_independent(candidates, np.argsort(-worth, kind="stable"))
        self._commit(candidates.kept(chosen), drift[chosen])
        return bool(chosen.any())

    def _touching(self, rows: Bools) -> Bools:
        """True for rows that share a vertex with any of `rows`."""
        is_touched = np.zeros(len(self.x), dtype=bool)
        is_touched[self.tets[rows]] = True
        is_touched[OUTSIDE] = False
        return np.asarray(is_touched[self.tets].any(axis=1))

    def _gain(self, cavities: Cavities) -> FloatArray:
        """Return the increase of the smallest size in each cavity, (k,) [m].

        Sizes count only up to the target size. An increase that is too small counts as 0.
        """
        before, after = np.full(cavities.total, np.inf), np.full(cavities.total, self.target_size)
        np.minimum.at(before, cavities.removed_of, self.sizes[cavities.removed])
        np.minimum.at(after, cavities.added_of, cavity.sizes(self.x, cavities.added))
        return np.where(after > _MIN_GAIN * before, after - before, 0.0)

    def _moves(self, mesh: ClosedMesh, size: FloatArray, bad: Ints) -> Cavities:
        """Return cavities that move each corner of bad tetrahedra to the best of a few trial positions."""
        order = bad[np.argsort(size[bad], kind="stable")]
        vertices, first = np.unique(mesh.tets[order].ravel(), return_index=True)
        worst = order[first // 4]
        extent = np.linalg.norm(np.ptp(self.x[mesh.tets[worst]], axis=1), axis=1)[:, None]
        slope = cavity.size_slopes(self.x, mesh.tets[worst], vertices)
        slope_norm = np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-30)
        step = (
            np.minimum((self.target_size - size[worst])[:, None] / slope_norm, 0.3 * extent)
            * slope
            / slope_norm
        )
        directions = self.random.normal(size=(len(_RANDOM_STEPS), len(vertices), 3))
        directions *= extent / np.linalg.norm(directions, axis=2, keepdims=True)
        moves = [factor * step for factor in _GRADIENT_STEPS]
        moves += [factor * direction for factor, direction in zip(_RANDOM_STEPS, directions, strict=True)]
        projections = self._slide_projections(mesh, vertices)

        new = len(self.x) + np.arange(len(vertices))
        trial = cavity.collapses(mesh, vertices, new)
        self.x = np.concatenate([self.x, self.x[vertices]])
        self.keys = np.r_[self.keys, self._draw_keys(len(vertices))]
        self.origin = np.r_[self.origin, self.origin[vertices]]
        best, best_size = self.x[vertices], np.full(len(vertices), -np.inf)
        for move in moves:
            self.x[new] = self.x[vertices] + np.einsum("kab,kb->ka", projections, move)
            smallest = np.full(len(vertices), np.inf)
            np.minimum.at(smallest, trial.added_of, cavity.sizes(self.x, trial.added))
            better = smallest > best_size
            best[better], best_size[better] = self.x[new[better]], smallest[better]
        self.x[new] = best
        return trial

    def _slide_projections(self, mesh: ClosedMesh, vertices: Ints) -> FloatArray:
        """Return projections onto the allowed moves of vertices, (k, 3, 3).

        Inner vertices can move in all directions, surface vertices only along the surface or a crease.
        """
        rows, of = mesh.star(vertices)
        faces, of = patches.outer_faces(mesh.tets[rows], of)
        normal = patches.area_vectors(self.x[faces])
        length = np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None, None]
        moment = np.zeros((len(vertices), 3, 3))
        np.add.at(moment, of, normal[:, :, None] * normal[:, None, :] / length)
        value, axis = np.linalg.eigh(moment)
        free = axis * (value <= _FLAT * value[:, 2:])[:, None, :]
        return np.asarray(free @ np.swapaxes(free, 1, 2))

    def _fits(self, cavities: Cavities) -> tuple[FloatArray, Bools]:
        """Check which changes the surface allows.

        Returns: upper bound of the surface's displacement at each cavity, (k,) [m]; and True for cavities
            that are allowed, (k,).
        """
        count = cavities.total
        old, old_of = patches.outer_faces(self.tets[cavities.removed], cavities.removed_of)
        new, new_of = patches.outer_faces(cavities.added, cavities.added_of)
        fits = patches.largest_turn(self.x[old], old_of, self.x[new], new_of, count) > _MIN_NORMAL_COSINE
        fits[np.setdiff1d(old_of, new_of)] = False  # a component must not vanish
        fits[cavities.added_of[cavity.is_flat(self.x, cavities.added)]] = False
        old, old_of, new, new_of = (
            old[fits[old_of]],
            old_of[fits[old_of]],
            new[fits[new_of]],
            new_of[fits[new_of]],
        )
        drift = np.zeros(count)
        np.maximum.at(drift, cavities.removed_of, self.drift[cavities.removed])
        drift += patches.distance(self.x[old], old_of, self.x[new], new_of, count)
        return drift, fits & (drift <= self.tolerance)

    def _select_independent(self, cavities: Cavities, order: Ints) -> Bools:
        """Select cavities without common vertices, in `order` of priority, within the volume budget.

        Returns: True for selected cavities, (k,).
        """
        count = cavities.total
        rank = np.empty(count, dtype=np.int64)
        rank[order] = np.arange(count)
        vertices = np.concatenate([self.tets[cavities.removed], cavities.added]).ravel()
        of = np.concatenate([cavities.removed_of, cavities.added_of]).repeat(4)
        vertices, of = vertices[vertices != OUTSIDE], of[vertices != OUTSIDE]
        chosen, undecided = np.zeros(count, dtype=bool), np.ones(count, dtype=bool)
        while undecided.any():
            first = np.full(len(self.x), count)
            np.minimum.at(first, vertices[undecided[of]], rank[of[undecided[of]]])
            accepted = undecided.copy()
            accepted[of[first[vertices] != rank[of]]] = False
            chosen |= accepted
            is_used = np.zeros(len(self.x), dtype=bool)
            is_used[vertices[accepted[of]]] = True
            undecided[of[is_used[vertices]]] = False
        change = np.bincount(cavities.added_of, cavity.volumes(self.x, cavities.added), count)
        change -= np.bincount(cavities.removed_of, cavity.volumes(self.x, self.tets[cavities.removed]), count)
        spent = np.cumsum(np.where(chosen, np.abs(change), 0.0)[order])
        chosen[order[spent > self.budget]] = False
        self.budget -= float(np.abs(change[chosen]).sum())
        return chosen

    def _commit(self, cavities: Cavities, drift: FloatArray) -> None:
        source = np.where(cavities.parent < 0, -1, self.source[cavities.parent])
        no_parent = np.flatnonzero((cavities.parent < 0) & (cavities.added != OUTSIDE).all(axis=1))
        source[no_parent] = self._sources(cavities, no_parent)
        keep = np.ones(len(self.tets), dtype=bool)
        keep[cavities.removed] = False
        outer = (cavities.added == OUTSIDE).any(axis=1)
        self.drift = np.r_[self.drift[keep], np.where(outer, drift[cavities.added_of], 0.0)]
        self.tets = np.concatenate([self.tets[keep], cavities.added])
        self.source = np.r_[self.source[keep], source]
        self.sizes = np.r_[self.sizes[keep], cavity.sizes(self.x, cavities.added)]

    def _sources(self, cavities: Cavities, added: Ints) -> Ints:
        """Return the original tetrahedron for each tetrahedron in `added`, (k,).

        It is the original of the removed tetrahedron in which the centre of the added tetrahedron lies
        deepest.
        """
        real = self.source[cavities.removed] >= 0
        removed = cavities.removed[real]
        i, j = patches.pairs(cavities.added_of[added], cavities.removed_of[real], cavities.total)
        corners = self.x[self.tets[removed]]
        centre = self.x[cavities.added[added]].mean(axis=1)
        depth = shares_by(edge_inverses(corners)[j], centre[i] - corners[j, 0]).min(axis=1)
        order = np.lexsort((-depth, i))
        return np.asarray(self.source[removed[j[order[np.searchsorted(i, np.arange(len(added)))]]]])

    def result(self) -> Improved:
        """Return the improved mesh, with vertices and tetrahedra in the original order."""
        real = np.flatnonzero(self.source >= 0)
        real = real[np.argsort(self.source[real], kind="stable")]
        used = np.unique(self.tets[real])
        used = used[np.argsort(self.origin[used], kind="stable")]
        new_index = np.zeros(len(self.x), dtype=np.int32)
        new_index[used] = np.arange(len(used))
        return Improved(self.x[used], new_index[self.tets[real]], self.source[real].astype(np.int32))
