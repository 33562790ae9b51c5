"""Limbs and sheets that a cage leaves out, being too thin for its cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.cages.connected import components, parts_of
from taichi_soft.cages.graded import around
from taichi_soft.cages.lattice import Lattice
from taichi_soft.cages.mesher import winding_number
from taichi_soft.cages.solid import Solid
from taichi_soft.cages.welding import places_of
from taichi_soft.meshing import TetMesh
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.locating import Locator

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

ROD = 18.0
"""Thicknesses along a cube, up to which a rod is kept."""

KEEPING = 8.0
"""Thicknesses along a cube, up to which every rod is kept without halving cubes."""

MOST_REFINE = 3
"""Octaves."""

PITCH = 0.25
"""Between points that stand for the surface, in cells."""

FINE_PITCH = 1 / 24
"""The same, where something is left out."""

LOST = 1.25
"""Cells from the cage, beyond which a point is left out: corners are rounded by less."""

MOST_CUBES = 64
"""In which it is looked whether the surface encloses something."""

INSIDE = 0.5
"""Winding number from which on a point is in the solid."""

OWN = 1e-6
"""Of the size: a triangle that is nearer to a point is the one that it lies on, or a copy of it."""

ROOT = 0.2
"""Cells from the cage, from which on a limb has left it."""

RAYS = 256
"""By which the thickness is told."""

SLIGHT = 0.1
"""Of what is measured near a limb is less than its thickness; what it grows from is thicker."""

CHUNK = 1 << 20
"""Pairs of rays and triangles that are looked at together."""


def points_on(corners: FloatArray, pitch: float) -> tuple[FloatArray, Ints]:
    """Points on triangles (m, 3, 3), some in each and none farther from the next than about `pitch` [m].

    Returns: (k, 3) [m], and the triangle of each, (k,).
    """
    lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    first = lengths.argmax(axis=1)
    rows = np.arange(len(corners))
    start = corners[rows, first]
    along, up = corners[rows, (first + 1) % 3] - start, corners[rows, (first + 2) % 3] - start
    longest = np.maximum(lengths.max(axis=1), 1e-300)
    height = np.linalg.norm(np.cross(along, up), axis=1) / longest
    columns = np.maximum(np.ceil(longest / pitch), 1.0).astype(np.int64)
    counts = columns * np.maximum(np.ceil(height / pitch), 1.0).astype(np.int64)
    triangle = np.repeat(rows, counts)
    number = np.arange(len(triangle)) - np.repeat(np.cumsum(counts) - counts, counts)
    width = columns[triangle]
    v = (number // width + 0.5) / (counts[triangle] // width)
    u = (number % width + 0.5) / width * (1.0 - v)
    return start[triangle] + u[:, None] * along[triangle] + v[:, None] * up[triangle], triangle


def _distances(locator: Locator, mesh: TetMesh, points: FloatArray) -> FloatArray:
    """Of points from a mesh, (k,) [m]."""
    tet, shares = locator(points)
    nearest = np.einsum("kc,kci->ki", shares, mesh.vertices[mesh.tets[tet]])
    return np.asarray(np.linalg.norm(nearest - points, axis=1))


def _are_in(lattice: Lattice, points: FloatArray, cubes: Bools) -> Bools:
    return np.asarray(cubes[tuple(_cube_at(lattice, points).T)])


def _cube_at(lattice: Lattice, points: FloatArray) -> Ints:
    places = ((points - lattice.origin) / lattice.edge).astype(np.int64)
    return np.clip(places, 0, np.array(lattice.cubes) - 1)


def cubes_of(lattice: Lattice, points: FloatArray) -> Bools:
    """Which cubes hold one of some points, of the shape of the lattice."""
    held = np.zeros(lattice.cubes, dtype=np.bool_)
    held[tuple(_cube_at(lattice, points).T)] = True
    return held


@dataclass(frozen=True)
class Thin:
    """Limbs and sheets that cells as large as asked for leave out: how thick the thinnest are, about [m];
    infinity where there are none."""

    kept: float  # by smaller cells
    lost: float
    octaves: int  # how often cells were halved

    def words(self, cell_size: float) -> tuple[str, ...]:
        """What to tell of it.

        Args: cell_size: that was asked for [m].
        """
        told = []
        if np.isfinite(self.kept):
            told.append(
                f"limbs or sheets of about {self.kept:.2g} m are too thin for cells of {cell_size:.3g} m: "
                f"round them cells are {cell_size / 2**self.octaves:.3g} m, and substeps as much shorter. "
                "refine=0 leaves them out"
            )
        if np.isfinite(self.lost):
            octaves = max(1, int(np.ceil(np.log2(cell_size / (ROD * self.lost)))))
            told.append(
                f"limbs or sheets of about {self.lost:.2g} m are left out, too thin for cells of "
                f"{cell_size:.3g} m: they are drawn, but neither bend nor touch anything. "
                f"cell_size={KEEPING * self.lost:.2g} keeps them"
                + (f", or refine={octaves}" if octaves <= MOST_REFINE else "")
            )
        return tuple(told)


@dataclass(frozen=True, eq=False)
class LeftOut:
    """Where a cage leaves out what it should carry."""

    cubes: Bools  # of the lattice, in which the surface is and the cage is not, and where it leaves this
    bare: Bools  # those of them without a vertex of the cage
    thickness: FloatArray  # of the limb or sheet there, of the shape of the lattice; infinity elsewhere [m]
    points: FloatArray  # (k, 3), on the surface in or beside these cubes [m]

    @property
    def thinnest(self) -> float:
        """[m]."""
        return float(self.thickness.min())

    def among(self, lattice: Lattice, cubes: Bools) -> LeftOut:
        """What of it lies in or beside some of its cubes."""
        points = self.points[_are_in(lattice, self.points, around(cubes))]
        return LeftOut(cubes, self.bare & cubes, np.where(cubes, self.thickness, np.inf), points)

    def joined(self, other: LeftOut) -> LeftOut:
        """What either leaves out."""
        return LeftOut(
            self.cubes | other.cubes,
            self.bare | other.bare,
            np.minimum(self.thickness, other.thickness),
            np.concatenate([self.points, other.points]),
        )


def far_points(lattice: Lattice, corners: FloatArray, mesh: TetMesh) -> tuple[FloatArray, Ints]:
    """Points on the surface that are left out of a cage, (k, 3) [m], and the triangle of each, (k,).

    Args:
        lattice: of the cubes that were asked for.
        corners: of the surface's triangles, (m, 3, 3) [m].
        mesh: the cage.
    """
    points, triangle = points_on(corners, PITCH * lattice.edge)
    # Cubes first: for most surfaces no more is needed.
    may_be = _are_in(lattice, points, ~cubes_of(lattice, mesh.vertices))
    if may_be.any():
        may_be[may_be] = _distances(Locator(mesh), mesh, points[may_be]) > LOST * lattice.edge
    return points[may_be], triangle[may_be]


def torn_points(solid: Solid, vertices: FloatArray, triangles: Ints) -> FloatArray:
    """Points on the surface between parts of a solid that are one, as triangles lead from one to the other:
    too thin a limb is lost between voxels. (k, 3) [m].

    Args:
        vertices: of the surface, (n, 3) [m].
        triangles: (m, 3).
    """
    size = float(np.ptp(vertices[np.unique(triangles)], axis=0).max())
    _, welded = np.unique(places_of(vertices, size)[triangles], return_inverse=True)
    welded = welded.reshape(-1, 3)
    piece = components(int(welded.max()) + 1, np.concatenate([welded[:, :2], welded[:, 1:]]))[welded[:, 0]]
    points, triangle = points_on(vertices[triangles], solid.spacing)
    voxels = ((points - solid.origin) / solid.spacing).astype(np.int64)
    part = parts_of(solid.fill)[tuple(np.clip(voxels, 0, np.array(solid.fill.shape) - 1).T)]
    on = np.stack([piece[triangle], part], axis=1)
    pieces, counts = np.unique(np.unique(on[part >= 0], axis=0)[:, 0], return_counts=True)
    return np.asarray(points[(part < 0) & np.isin(on[:, 0], pieces[counts > 1])])


def solid_points(
    lattice: Lattice, points: FloatArray, triangle: Ints, corners: FloatArray, solid: Solid
) -> FloatArray:
    """Those of some points that share a cube with a part of the solid: a wall without thickness is none.

    Args:
        points: on the surface, (k, 3) [m].
        triangle: of each, (k,).
        corners: of all triangles, (m, 3, 3) [m].
    """
    is_solid = _are_in(lattice, points, cubes_of(lattice, solid.quadrature()[0]))
    # A needle along an axis may lie between all lines by which the solid was told.
    doubtful = np.flatnonzero(~is_solid)
    cubes = np.ravel_multi_index(tuple(_cube_at(lattice, points[doubtful]).T), lattice.cubes)
    order = np.random.default_rng(0).permutation(len(doubtful))
    few = doubtful[order[np.unique(cubes[order], return_index=True)[1]]][:MOST_CUBES]
    near = corners[np.unique(triangle)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[triangle[few]]
    ways = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    for point, way in zip(points[few], ways, strict=True):
        for away in chords(point[None], way[None], near):
            if np.isfinite(away) and abs(winding_number(point + 0.5 * away * way, corners)) > INSIDE:
                here = cubes_of(lattice, point[None])
                is_solid |= _are_in(lattice, points, here)
    return points[is_solid]


def left_out(lattice: Lattice, corners: FloatArray, mesh: TetMesh, far: FloatArray) -> LeftOut:
    """What is at some points far from a cage, and what leads there.

    Args: far: `far_points`, one at least; the others as there.
    """
    lost = around(around(cubes_of(lattice, far)))
    points, triangle = points_on(corners, PITCH * lattice.edge)
    bare = cubes_of(lattice, points) & ~cubes_of(lattice, mesh.vertices) & lost
    # Where a limb leaves the cage, cubes hold both.
    roots = points[_are_in(lattice, points, around(bare) & ~bare)]
    cubes = bare | cubes_of(lattice, roots[_distances(Locator(mesh), mesh, roots) > ROOT * lattice.edge])
    near = corners[np.unique(triangle[_are_in(lattice, points, around(cubes))])]
    points, triangle = points_on(near, FINE_PITCH * lattice.edge)
    normals = np.cross(near[:, 1] - near[:, 0], near[:, 2] - near[:, 0])
    thick, limbs = np.full(lattice.cubes, np.inf), parts_of(cubes.astype(np.float64))
    limb, in_bare = limbs[tuple(_cube_at(lattice, points).T)], _are_in(lattice, points, bare)
    for number in range(int(limbs.max()) + 1):
        mine = (limb == number) & in_bare
        thick[limbs == number] = thickness(points[mine], normals[triangle[mine]], near)
    bins = np.floor(points / (FINE_PITCH * lattice.edge))
    points = points[np.unique(bins, axis=0, return_index=True)[1]]
    return LeftOut(cubes, bare, thick, points[_are_in(lattice, points, around(cubes))])


def thickness(points: FloatArray, normals: FloatArray, corners: FloatArray) -> float:
    """Of what triangles enclose, as lines through points along the normals there tell [m].

    Args:
        points: on the triangles, (k, 3) [m].
        normals: (k, 3), of any length.
        corners: of the triangles, (m, 3, 3) [m].
    Returns: infinity where no line meets a triangle again.
    """
    few = np.unique(np.linspace(0, len(points) - 1, min(RAYS, len(points))).astype(np.int64))
    lengths = np.linalg.norm(normals[few], axis=1, keepdims=True)
    found = np.abs(chords(points[few], normals[few] / np.where(lengths > 0.0, lengths, 1.0), corners))
    found = found[np.isfinite(found)]
    return float(np.quantile(found, SLIGHT)) if len(found) else np.inf


def chords(points: FloatArray, ways: FloatArray, corners: FloatArray) -> FloatArray:
    """How far along lines through points on triangles the next triangle is, below 0 where it is behind, (k,)
    [m]; infinity where there is none.

    Args:
        points: (k, 3) [m].
        ways: of the lines, (k, 3), of length 1.
        corners: of the triangles, (m, 3, 3) [m].
    """
    own = OWN * float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    nearest = np.full(len(points), np.inf)
    rows = max(1, CHUNK // len(corners))
    for start in range(0, len(points), rows):
        some = slice(start, start + rows)
        away = _meetings(points[some], ways[some], corners)
        distance = np.where(np.abs(away) > own, np.abs(away), np.inf)
        best = distance.argmin(axis=1)
        each = np.arange(len(best))
        nearest[some] = np.where(np.isfinite(distance[each, best]), away[each, best], np.inf)
    return nearest


def _meetings(points: FloatArray, ways: FloatArray, corners: FloatArray) -> FloatArray:
    """How far along each line each triangle is met, (k, m) [m], NaN where it is not.

    Möller and Trumbore, "Fast, minimum storage ray/triangle intersection" (1997).
    """
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(ways[:, None], other)
    det = np.einsum("kmi,mi->km", p, one)
    from_corner = points[:, None] - corners[:, 0]
    q = np.cross(from_corner, one)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("kmi,kmi->km", p, from_corner) / det
        v = np.einsum("kmi,ki->km", q, ways) / det
        away = np.einsum("kmi,mi->km", q, other) / det
        return np.where((u >= 0.0) & (v >= 0.0) & (u + v <= 1.0), away, np.nan)
