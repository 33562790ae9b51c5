"""A mesh without the few tetrahedra that ask for tiny steps: they are flipped away, collapsed or reshaped.

In rounds: of all that could be done about a bad tetrahedron, what makes the worst of its cavity largest is
done, in as many places at once as do not touch. The smallest size of the mesh so never falls.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.math.barycentric import edge_inverses, shares_by
from taichi_soft.meshing import cavities as cavity
from taichi_soft.meshing import patches
from taichi_soft.meshing.arrays import FloatArray, IntArray
from taichi_soft.meshing.cavities import OUTSIDE, Bools, Cavities, Closed, Ints
from taichi_soft.meshing.topology import LOCAL_EDGES

SMALL = 0.3
"""A tetrahedron below this part of the median size is improved: it asks for three times the substeps."""

_ROUNDS = 100
_GENTLE_ROUNDS = 3  # without collapses: what flips and moves can mend keeps its vertices
_PATIENCE = 6  # rounds in vain before giving up: each tries other moves
_GAIN = 1.02  # by which the worst of a cavity has to grow, so that rounds end
_VOLUME = 0.01  # part of the body's that all changes of the surface together may take or add
_TURN = 0.77  # cosine of how far a new triangle of the surface may turn from those before
_THRIFT = 0.9  # how much less a gain counts that uses up the tolerance
_FLAT = 0.05  # part of the normals' second moment below which a vertex of the surface may slide that way
_UPHILL = (1.5, 1.0, 0.5, 0.2, 0.05)  # moves tried, in steps to where the worst tetrahedron would be good
_ANYWHERE = (0.1, 0.1, 0.03, 0.01)  # and in sizes of that tetrahedron, in directions drawn


class Improved(NamedTuple):
    """Vertices (n, 3) [m], tetrahedra (m, 4) and, (m,), the old tetrahedron whose place each has."""

    vertices: FloatArray
    tets: IntArray
    source: IntArray


def improve(
    vertices: FloatArray, tets: IntArray, surface: IntArray, *, size: float | None, tolerance: float
) -> Improved | None:
    """A mesh whose tetrahedra have at least a size, as `cavities.sizes` has it, where that can be had.

    Args:
        size: [m]; None takes `SMALL` of the median.
        tolerance: how far the surface may move [m].
    Returns: None if there is nothing to do, or nothing that can be done.
    """
    work = _Work(vertices, tets, surface, size, tolerance)
    changed, in_vain = False, 0
    for number in range(_ROUNDS):
        done = work.round(number < _GENTLE_ROUNDS)
        changed |= done
        in_vain = 0 if done else in_vain + 1
        if in_vain == _PATIENCE:
            break
    return work.result() if changed else None


class _Work:
    """The mesh as it changes. A vertex that moves becomes a new one; what is not used goes at the end."""

    def __init__(
        self, vertices: FloatArray, tets: IntArray, surface: IntArray, size: float | None, tolerance: float
    ) -> None:
        self.tolerance = tolerance
        self.random = np.random.default_rng(0)
        self.x = np.concatenate([np.zeros((1, 3)), vertices])  # first the vertex outside, which has no place
        beyond = np.hstack([surface + 1, np.full((len(surface), 1), OUTSIDE)])
        self.tets: Ints = np.concatenate([tets + 1, beyond]).astype(np.int64)
        self.source = np.r_[np.arange(len(tets)), np.full(len(surface), -1)]
        self.sizes = cavity.sizes(self.x, self.tets)
        self.wanted = SMALL * float(np.median(self.sizes[: len(tets)])) if size is None else size
        self.origin = np.arange(len(self.x))  # vertex that each was before it moved
        self.drift = np.zeros(len(self.tets))  # how far each triangle of the surface may have moved [m]
        self.keys = self._draw_keys(len(self.x))
        self.budget = _VOLUME * float(cavity.volumes(self.x, self.tets).sum())

    def _draw_keys(self, count: int) -> NDArray[np.uint64]:
        return self.random.integers(2**64, size=count, dtype=np.uint64)

    def round(self, gentle: bool) -> bool:
        """Do what can be done at once, without collapses if `gentle`. Returns whether it was anything."""
        is_bad = self.sizes < self.wanted
        if not is_bad.any():
            return False
        # Cavities are stars of a bad one's corners; what is tested for them touches those.
        rows = np.flatnonzero(self._touching(self._touching(is_bad)))
        mesh, bad = Closed(self.tets[rows], self.keys), np.flatnonzero(is_bad[rows])
        edges = np.unique(np.sort(mesh.tets[bad][:, LOCAL_EDGES].reshape(-1, 2), axis=1), axis=0)
        found = [cavity.face_flips(mesh, bad), *cavity.edge_removals(self.x, mesh, edges)]
        found.append(self._moves(mesh, self.sizes[rows], bad))
        if not gentle:
            gone, into = np.concatenate([edges, edges[:, ::-1]]).T
            merged = cavity.collapses(mesh, gone, into)
            better = self._gain(merged.in_rows(rows)) > 0
            better[better] = cavity.meets_link_condition(mesh, gone[better], into[better])
            found.append(merged.kept(better))
        ready = cavity.joined(found).in_rows(rows)
        gain = self._gain(ready)
        ready, gain = ready.kept(gain > 0), gain[gain > 0]
        drift, fits = self._fits(ready)
        ready, gain, drift = ready.kept(fits), gain[fits], drift[fits]
        # How far the surface may still move is not spent where as much can be had without.
        worth = gain * (1 - _THRIFT * drift / self.tolerance)
        chosen = self._apart(ready, np.argsort(-worth, kind="stable"))
        self._commit(ready.kept(chosen), drift[chosen])
        return bool(chosen.any())

    def _touching(self, rows: Bools) -> Bools:
        """The rows that have a vertex in common with some."""
        near = np.zeros(len(self.x), dtype=bool)
        near[self.tets[rows]] = True
        near[OUTSIDE] = False
        return np.asarray(near[self.tets].any(axis=1))

    def _gain(self, cavities: Cavities) -> FloatArray:
        """By how much the smallest size grows, as far as wanted, (k,) [m]; 0 where that is too little."""
        before, after = np.full(cavities.total, np.inf), np.full(cavities.total, self.wanted)
        np.minimum.at(before, cavities.removed_of, self.sizes[cavities.removed])
        np.minimum.at(after, cavities.added_of, cavity.sizes(self.x, cavities.added))
        return np.where(after > _GAIN * before, after - before, 0.0)

    def _moves(self, mesh: Closed, size: FloatArray, bad: Ints) -> Cavities:
        """The best of a few places for each corner of the bad tetrahedra."""
        order = bad[np.argsort(size[bad], kind="stable")]
        who, first = np.unique(mesh.tets[order].ravel(), return_index=True)
        worst = order[first // 4]
        reach = np.linalg.norm(np.ptp(self.x[mesh.tets[worst]], axis=1), axis=1)[:, None]
        slope = cavity.size_slopes(self.x, mesh.tets[worst], who)
        steep = np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-30)
        step = np.minimum((self.wanted - size[worst])[:, None] / steep, 0.3 * reach) * slope / steep
        drawn = self.random.normal(size=(len(_ANYWHERE), len(who), 3))
        drawn *= reach / np.linalg.norm(drawn, axis=2, keepdims=True)
        moves = [part * step for part in _UPHILL]
        moves += [part * way for part, way in zip(_ANYWHERE, drawn, strict=True)]
        slides = self._slides(mesh, who)

        new = len(self.x) + np.arange(len(who))
        trial = cavity.collapses(mesh, who, new)
        self.x = np.concatenate([self.x, self.x[who]])
        self.keys = np.r_[self.keys, self._draw_keys(len(who))]
        self.origin = np.r_[self.origin, self.origin[who]]
        best, lead = self.x[who], np.full(len(who), -np.inf)
        for move in moves:
            self.x[new] = self.x[who] + np.einsum("kab,kb->ka", slides, move)
            smallest = np.full(len(who), np.inf)
            np.minimum.at(smallest, trial.added_of, cavity.sizes(self.x, trial.added))
            better = smallest > lead
            best[better], lead[better] = self.x[new[better]], smallest[better]
        self.x[new] = best
        return trial

    def _slides(self, mesh: Closed, who: Ints) -> FloatArray:
        """Projections (k, 3, 3) onto where each may go: anywhere inside, along the surface or its crease."""
        rows, of = mesh.star(who)
        faces, of = patches.outer_faces(mesh.tets[rows], of)
        normal = patches.area_vectors(self.x[faces])
        length = np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None, None]
        moment = np.zeros((len(who), 3, 3))
        np.add.at(moment, of, normal[:, :, None] * normal[:, None, :] / length)
        value, axis = np.linalg.eigh(moment)
        free = axis * (value <= _FLAT * value[:, 2:])[:, None, :]
        return np.asarray(free @ np.swapaxes(free, 1, 2))

    def _fits(self, cavities: Cavities) -> tuple[FloatArray, Bools]:
        """How far the surface will have moved at most at each cavity [m], and whether it may be filled."""
        count = cavities.total
        old, old_of = patches.outer_faces(self.tets[cavities.removed], cavities.removed_of)
        new, new_of = patches.outer_faces(cavities.added, cavities.added_of)
        fits = patches.largest_turn(self.x[old], old_of, self.x[new], new_of, count) > _TURN
        fits[np.setdiff1d(old_of, new_of)] = False  # a part must not vanish
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

    def _apart(self, cavities: Cavities, order: Ints) -> Bools:
        """Which cavities to take, the first in `order` first, so that no two have a vertex in common."""
        count = cavities.total
        rank = np.empty(count, dtype=np.int64)
        rank[order] = np.arange(count)
        vertices = np.concatenate([self.tets[cavities.removed], cavities.added]).ravel()
        of = np.concatenate([cavities.removed_of, cavities.added_of]).repeat(4)
        vertices, of = vertices[vertices != OUTSIDE], of[vertices != OUTSIDE]
        chosen, waits = np.zeros(count, dtype=bool), np.ones(count, dtype=bool)
        while waits.any():
            first = np.full(len(self.x), count)
            np.minimum.at(first, vertices[waits[of]], rank[of[waits[of]]])
            takes = waits.copy()
            takes[of[first[vertices] != rank[of]]] = False
            chosen |= takes
            taken = np.zeros(len(self.x), dtype=bool)
            taken[vertices[takes[of]]] = True
            waits[of[taken[vertices]]] = False
        change = np.bincount(cavities.added_of, cavity.volumes(self.x, cavities.added), count)
        change -= np.bincount(cavities.removed_of, cavity.volumes(self.x, self.tets[cavities.removed]), count)
        spent = np.cumsum(np.where(chosen, np.abs(change), 0.0)[order])
        chosen[order[spent > self.budget]] = False
        self.budget -= float(np.abs(change[chosen]).sum())
        return chosen

    def _commit(self, cavities: Cavities, drift: FloatArray) -> None:
        source = np.where(cavities.parent < 0, -1, self.source[cavities.parent])
        homeless = np.flatnonzero((cavities.parent < 0) & (cavities.added != OUTSIDE).all(axis=1))
        source[homeless] = self._sources(cavities, homeless)
        keep = np.ones(len(self.tets), dtype=bool)
        keep[cavities.removed] = False
        beyond = (cavities.added == OUTSIDE).any(axis=1)
        self.drift = np.r_[self.drift[keep], np.where(beyond, drift[cavities.added_of], 0.0)]
        self.tets = np.concatenate([self.tets[keep], cavities.added])
        self.source = np.r_[self.source[keep], source]
        self.sizes = np.r_[self.sizes[keep], cavity.sizes(self.x, cavities.added)]

    def _sources(self, cavities: Cavities, added: Ints) -> Ints:
        """For some of what is added the source of that one of the cavity in which the centre lies deepest."""
        real = self.source[cavities.removed] >= 0
        removed = cavities.removed[real]
        i, j = patches.pairs(cavities.added_of[added], cavities.removed_of[real], cavities.total)
        corners = self.x[self.tets[removed]]
        centre = self.x[cavities.added[added]].mean(axis=1)
        depth = shares_by(edge_inverses(corners)[j], centre[i] - corners[j, 0]).min(axis=1)
        order = np.lexsort((-depth, i))
        return np.asarray(self.source[removed[j[order[np.searchsorted(i, np.arange(len(added)))]]]])

    def result(self) -> Improved:
        """Vertices and tetrahedra in the order of those they were."""
        real = np.flatnonzero(self.source >= 0)
        real = real[np.argsort(self.source[real], kind="stable")]
        used = np.unique(self.tets[real])
        used = used[np.argsort(self.origin[used], kind="stable")]
        number = np.zeros(len(self.x), dtype=np.int32)
        number[used] = np.arange(len(used))
        return Improved(self.x[used], number[self.tets[real]], self.source[real].astype(np.int32))
