"""A mesh without the few tetrahedra that ask for tiny steps: they are flipped away, collapsed or reshaped."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from taichi_soft.meshing.arrays import FloatArray, IntArray
from taichi_soft.meshing.cavities import (
    OUTSIDE,
    Bools,
    Cavities,
    Closed,
    Ints,
    collapses,
    edge_removals,
    face_flips,
    joined,
    meets_link_condition,
    ranges,
    sizes,
)
from taichi_soft.meshing.topology import LOCAL_EDGES, LOCAL_FACES

SMALL = 0.3
"""A tetrahedron is improved if its size is below this part of the median: it asks for three times the substeps."""

_ROUNDS = 40
_GENTLE_ROUNDS = 6  # without collapses: what flips and moves can mend keeps its vertices
_GAIN = 1.02  # by which the worst of a cavity has to grow, so that rounds end
_VOLUME = 0.01  # of the body, that all changes of the surface together may take or add
_TURN = 0.77  # cosine of how far a new triangle of the surface may turn from those before
_FLAT = 0.05  # part of the normals' second moments below which a surface vertex may slide that way


class Arrays(NamedTuple):
    """A mesh and where it comes from."""

    vertices: FloatArray
    tets: IntArray
    source: IntArray  # (m,) old tetrahedron that each is, or whose place it took


def improve(
    vertices: FloatArray, tets: IntArray, surface: IntArray, size: float, tolerance: float
) -> Arrays | None:
    """The mesh with no tetrahedron smaller than `size` [m] that could be helped; None if there is nothing to do.

    Args:
        size: as `cavities.sizes` measures it.
        tolerance: how far the surface may move [m].
    """
    work = _Work(vertices, tets, surface, size, tolerance)
    changed = False
    for number in range(_ROUNDS):
        done = work.round(number)
        changed |= done > 0
        if done == 0 and number > _GENTLE_ROUNDS:
            break
    return work.result() if changed else None


class _Work:
    """The mesh as it changes. Vertices only become more; those that are no longer used go at the end."""

    def __init__(
        self, vertices: FloatArray, tets: IntArray, surface: IntArray, size: float, tolerance: float
    ) -> None:
        self.size, self.tolerance = size, tolerance
        self.random = np.random.default_rng(0)
        # Row 0 is the vertex outside; it has no place.
        self.x = np.concatenate([np.zeros((1, 3)), vertices])
        ghosts = np.hstack([surface + 1, np.full((len(surface), 1), OUTSIDE)])
        self.tets: Ints = np.concatenate([tets + 1, ghosts]).astype(np.int64)
        self.source = np.r_[np.arange(len(tets)), np.full(len(surface), -1)]
        self.origin = np.arange(len(self.x))  # vertex that each was before it moved
        self.drift = np.zeros(len(self.x))  # how far the surface round each may have moved [m]
        self.keys = self._new_keys(len(self.x))
        self.budget = _VOLUME * float(_volumes(self.x, tets + 1).sum())

    def _new_keys(self, count: int) -> np.ndarray:
        return self.random.integers(2**64, size=count, dtype=np.uint64)

    def round(self, number: int) -> int:
        """Improve as many cavities as do not touch each other; how many they were."""
        mesh = Closed(self.tets, self.keys)
        size = sizes(self.x, self.tets)
        bad = np.flatnonzero(size < self.size)
        if len(bad) == 0:
            return 0
        edges = np.unique(np.sort(self.tets[bad][:, LOCAL_EDGES].reshape(-1, 2), axis=1), axis=0)
        found = [face_flips(mesh, bad), *edge_removals(self.x, mesh, edges), self._moves(mesh, size, bad)]
        kinds = [0] * (len(found) - 1) + [1]
        if number >= _GENTLE_ROUNDS:
            gone, into = np.concatenate([edges, edges[:, ::-1]]).T
            merged = collapses(mesh, gone, into)
            better = self._gain(size, merged) > 0
            better[better] = meets_link_condition(mesh, gone[better], into[better])
            found.append(merged.kept(better))
            kinds.append(2)
        kind = np.repeat(kinds, [_count(part) for part in found])
        cavities = joined(found)
        gain = self._gain(size, cavities)
        cavities, kind, gain = cavities.kept(gain > 0), kind[gain > 0], gain[gain > 0]
        drift, fits = self._surface_drift(cavities)
        cavities, kind, gain, drift = cavities.kept(fits), kind[fits], gain[fits], drift[fits]
        chosen = self._apart(cavities, np.lexsort((kind, -gain)))
        self._commit(cavities.kept(chosen), drift[chosen])
        return int(chosen.sum())

    def _gain(self, size: FloatArray, cavities: Cavities) -> FloatArray:
        """By how much the worst size grows, as far as it is asked for, (k,) [m]; 0 where it does not."""
        count = _count(cavities)
        before, after = np.full(count, np.inf), np.full(count, np.inf)
        np.minimum.at(before, cavities.removed_of, size[cavities.removed])
        np.minimum.at(after, cavities.added_of, sizes(self.x, cavities.added))
        after = np.minimum(after, self.size)
        return np.where((after > _GAIN * before) & (after > 0), after - before, 0.0)

    def _moves(self, mesh: Closed, size: FloatArray, bad: Ints) -> Cavities:
        """The best of a few places for each vertex of a bad tetrahedron."""
        corners = self.tets[bad]
        order = np.argsort(size[bad], kind="stable")
        who, first = np.unique(corners[order].ravel(), return_index=True)
        worst = bad[order[first // 4]]
        rows, of = mesh.star(who)
        # Up the slope of the worst tetrahedron's size, by what it lacks; and anywhere.
        reach = np.linalg.norm(np.ptp(self.x[self.tets[worst]], axis=1), axis=1)
        slope = self._slopes(who, self.tets[worst], 1e-4 * np.maximum(size[worst], 1e-6 * reach))
        steep = np.linalg.norm(slope, axis=1)
        up = slope / np.maximum(steep, 1e-30)[:, None]
        step = np.minimum((self.size - size[worst]) / np.maximum(steep, 1e-30), 0.3 * reach)
        places = [part * step[:, None] * up for part in (1.5, 1.0, 0.5, 0.2, 0.05)]
        places += [
            part * reach[:, None] * _directions(self.random, len(who)) for part in (0.1, 0.1, 0.03, 0.01)
        ]
        moves = np.stack(places, axis=1)  # (k, places, 3)
        moves = np.einsum("kab,kpb->kpa", self._slides(mesh, who), moves)
        tried = moves.shape[1]
        best, lead = np.zeros(len(who), dtype=np.int64), np.full(len(who), -np.inf)
        x = np.concatenate([self.x, np.zeros((len(who), 3))])
        trial = collapses(mesh, who, len(self.x) + np.arange(len(who)))
        for place in range(tried):
            x[len(self.x) :] = self.x[who] + moves[:, place]
            after = np.full(len(who), np.inf)
            np.minimum.at(after, trial.added_of, sizes(x, trial.added))
            better = after > lead
            best[better], lead[better] = place, after[better]
        self.x = np.concatenate([self.x, self.x[who] + moves[np.arange(len(who)), best]])
        self.keys = np.r_[self.keys, self._new_keys(len(who))]
        self.origin = np.r_[self.origin, self.origin[who]]
        self.drift = np.r_[self.drift, np.zeros(len(who))]
        return trial

    def _slopes(self, who: Ints, tets: Ints, step: FloatArray) -> FloatArray:
        """How the size of each tetrahedron grows with the place of one corner, by differences, (k, 3)."""
        p, corner = self.x[tets], (tets == who[:, None]).argmax(axis=1)
        rows = np.arange(len(tets))
        local = 1 + np.arange(4 * len(tets)).reshape(-1, 4)

        def at(offset: FloatArray) -> FloatArray:
            moved = p.copy()
            moved[rows, corner] += offset
            return sizes(np.concatenate([np.zeros((1, 3)), moved.reshape(-1, 3)]), local)

        axes = [step[:, None] * axis for axis in np.eye(3)]
        return np.stack([(at(axis) - at(-axis)) / (2 * step) for axis in axes], axis=1)

    def _slides(self, mesh: Closed, who: Ints) -> FloatArray:
        """Projections (k, 3, 3) onto where each vertex may go: along the surface, along a crease, anywhere inside."""
        rows, of = mesh.star(who)
        faces, of = _outer_faces(self.tets[rows], of)
        normal = _area_vectors(self.x[faces])
        length = np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None, None]
        moment = np.zeros((len(who), 3, 3))
        np.add.at(moment, of, normal[:, :, None] * normal[:, None, :] / length)
        value, axis = np.linalg.eigh(moment)
        free = axis * (value <= _FLAT * value[:, 2:])[:, None, :]
        return np.asarray(free @ np.swapaxes(free, 1, 2))

    def _surface_drift(self, cavities: Cavities) -> tuple[FloatArray, Bools]:
        """How far the surface may have moved at each cavity in the end [m], 0 where it stays; and whether it may."""
        count = _count(cavities)
        old, old_of = _outer_faces(self.tets[cavities.removed], cavities.removed_of)
        new, new_of = _outer_faces(cavities.added, cavities.added_of)
        i, j = _pairs(new_of, old_of, count)
        turn = np.full(len(new), -1.0)
        np.maximum.at(turn, i, np.einsum("ij,ij->i", self._normals(new)[i], self._normals(old)[j]))
        fits = np.ones(count, dtype=bool)
        fits[new_of[turn < _TURN]] = False
        fits[np.setdiff1d(old_of, new_of)] = False  # a part must not vanish
        drift = np.zeros(count)
        for here, here_of, there, there_of in ((old, old_of, new, new_of), (new, new_of, old, old_of)):
            points = np.einsum("sc,tcd->tsd", _SAMPLES, self.x[here[fits[here_of]]]).reshape(-1, 3)
            points_of = here_of[fits[here_of]].repeat(len(_SAMPLES))
            i, j = _pairs(points_of, there_of, count)
            near = np.full(len(points), np.inf)
            np.minimum.at(near, i, _squared_distances(points[i], self.x[there[j]]))
            np.maximum.at(drift, points_of, np.sqrt(near))
        before = np.zeros(count)
        np.maximum.at(before, old_of.repeat(3), self.drift[old].ravel())
        drift += before
        return drift, fits & (drift <= self.tolerance)

    def _normals(self, triangles: Ints) -> FloatArray:
        normal = _area_vectors(self.x[triangles])
        return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None])

    def _apart(self, cavities: Cavities, order: Ints) -> Bools:
        """Which cavities to take, the first in `order` first, so that no two have a vertex in common."""
        count = _count(cavities)
        rank = np.empty(count, dtype=np.int64)
        rank[order] = np.arange(count)
        vertices = np.concatenate([self.tets[cavities.removed], cavities.added]).ravel()
        of = np.concatenate([cavities.removed_of, cavities.added_of]).repeat(4)
        vertices, of = vertices[vertices != OUTSIDE], of[vertices != OUTSIDE]
        chosen, open_ = np.zeros(count, dtype=bool), np.ones(count, dtype=bool)
        while open_.any():
            first = np.full(len(self.x), count)
            here = open_[of]
            np.minimum.at(first, vertices[here], rank[of[here]])
            takes = open_.copy()
            takes[of[first[vertices] != rank[of]]] = False
            chosen |= takes
            taken = np.zeros(len(self.x), dtype=bool)
            taken[vertices[takes[of]]] = True
            open_[of[taken[vertices]]] = False
        change = np.bincount(cavities.added_of, _volumes(self.x, cavities.added), count)
        change -= np.bincount(cavities.removed_of, _volumes(self.x, self.tets[cavities.removed]), count)
        spent = np.cumsum(np.where(chosen, np.abs(change), 0.0)[order])
        chosen[order[spent > self.budget]] = False
        self.budget -= float(np.abs(change[chosen]).sum())
        return chosen

    def _commit(self, cavities: Cavities, drift: FloatArray) -> None:
        """Replace what the cavities hold."""
        source = np.where(cavities.parent < 0, -1, self.source[cavities.parent])
        free = (cavities.parent < 0) & (cavities.added != OUTSIDE).all(axis=1)
        source[free] = self._nearest_sources(cavities, np.flatnonzero(free))
        for tets, of in (
            (self.tets[cavities.removed], cavities.removed_of),
            (cavities.added, cavities.added_of),
        ):
            faces, face_of = _outer_faces(tets, of)
            np.maximum.at(self.drift, faces, drift[face_of, None])
        keep = np.ones(len(self.tets), dtype=bool)
        keep[cavities.removed] = False
        self.tets = np.concatenate([self.tets[keep], cavities.added])
        self.source = np.r_[self.source[keep], source]

    def _nearest_sources(self, cavities: Cavities, rows: Ints) -> Ints:
        """Of added tetrahedra the source of that one of the cavity in which their centre lies deepest."""
        real = self.source[cavities.removed] >= 0
        removed = cavities.removed[real]
        i, j = _pairs(cavities.added_of[rows], cavities.removed_of[real], _count(cavities))
        corners = self.x[self.tets[removed]]
        inverse = np.linalg.inv(np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2))
        centre = self.x[cavities.added[rows]].mean(axis=1)
        share = np.einsum("kab,kb->ka", inverse[j], centre[i] - corners[j, 0])
        depth = np.minimum(share.min(axis=1), 1 - share.sum(axis=1))
        order = np.lexsort((-depth, i))
        first = np.searchsorted(i[order], np.arange(len(rows)))
        return np.asarray(self.source[removed[j[order[first]]]])

    def result(self) -> Arrays:
        """The mesh without the vertex outside, vertices and tetrahedra in the order of their origins."""
        real = np.flatnonzero(self.source >= 0)
        real = real[np.argsort(self.source[real], kind="stable")]
        used = np.unique(self.tets[real])
        used = used[np.argsort(self.origin[used], kind="stable")]
        number = np.zeros(len(self.x), dtype=np.int32)
        number[used] = np.arange(len(used))
        return Arrays(self.x[used], number[self.tets[real]], self.source[real].astype(np.int32))


# Points of a triangle at which distances are taken: corners, thirds of the sides, the middle.
_SAMPLES = np.array([(i, j, 3 - i - j) for i in range(4) for j in range(4 - i)]) / 3.0


def _count(cavities: Cavities) -> int:
    return int(cavities.removed_of[-1]) + 1 if len(cavities.removed_of) else 0


def _volumes(x: FloatArray, tets: Ints | IntArray) -> FloatArray:
    """Signed volumes [m^3], 0 beyond the surface."""
    p = x[tets]
    six = np.einsum("ij,ij->i", p[:, 1] - p[:, 0], np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 0]))
    return np.where((tets == OUTSIDE).any(axis=1), 0.0, six / 6.0)


def _outer_faces(tets: Ints, of: Ints) -> tuple[Ints, Ints]:
    """Triangles of the surface (f, 3), wound outwards, among tetrahedra, and their entries of `of`."""
    row, corner = np.nonzero(tets == OUTSIDE)
    return tets[row[:, None], LOCAL_FACES[corner][:, ::-1]], of[row]


def _area_vectors(p: FloatArray) -> FloatArray:
    return np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])


def _pairs(first_of: Ints, second_of: Ints, count: int) -> tuple[Ints, Ints]:
    """All pairs of an entry of either that belong to the same of `count` cavities; both are sorted."""
    starts = np.searchsorted(second_of, first_of)
    counts = np.bincount(second_of, minlength=count)[first_of]
    return np.repeat(np.arange(len(first_of)), counts), ranges(starts, counts)


def _squared_distances(points: FloatArray, triangles: FloatArray) -> FloatArray:
    """From points (k, 3) to triangles (k, 3, 3) [m^2]."""
    normal = _area_vectors(triangles)
    inside = np.ones(len(points), dtype=bool)
    nearest = np.full(len(points), np.inf)
    for i in range(3):
        side, arm = triangles[:, (i + 1) % 3] - triangles[:, i], points - triangles[:, i]
        inside &= np.einsum("ij,ij->i", np.cross(side, arm), normal) >= 0
        part = np.einsum("ij,ij->i", arm, side) / np.maximum(np.einsum("ij,ij->i", side, side), 1e-300)
        rest = arm - np.clip(part, 0.0, 1.0)[:, None] * side
        nearest = np.minimum(nearest, np.einsum("ij,ij->i", rest, rest))
    height = np.einsum("ij,ij->i", points - triangles[:, 0], normal)
    length2 = np.maximum(np.einsum("ij,ij->i", normal, normal), 1e-300)
    return np.where(inside & (length2 > 1e-300), height**2 / length2, nearest)


def _directions(random: np.random.Generator, count: int) -> FloatArray:
    direction = random.normal(size=(count, 3))
    return np.asarray(direction / np.linalg.norm(direction, axis=1, keepdims=True))
