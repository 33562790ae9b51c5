"""Find the limbs and sheets that are too thin for the cells of a cage."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.cages.connected import components, parts_of
from taichi_soft.cages.graded import around
from taichi_soft.cages.lattice import Lattice
from taichi_soft.cages.mesher import winding_number
from taichi_soft.cages.solid import Solid
from taichi_soft.meshing import TetMesh
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.locating import Locator
from taichi_soft.meshing.welding import places_of

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

MAX_ROD_RATIO = 18.0
"""Largest ratio of a cube's edge to a rod's thickness at which the rod can be kept."""

SAFE_ROD_RATIO = 8.0
"""Largest ratio of a cube's edge to a rod's thickness at which every rod is kept without halving cubes."""

MAX_REFINE = 3
"""Largest valid value of the argument `refine`: the number of times that cells can be halved at thin limbs
and sheets."""

PITCH = 0.25
"""Distance between sample points on the whole surface, in cells."""

FINE_PITCH = 1 / 24
"""Distance between sample points on the missed parts of the surface, in cells."""

MISSED_DISTANCE = 1.25
"""Distance from the cage, in cells, beyond which a point counts as missed. Points at corners that the cage
rounds off are nearer."""

MAX_CUBES = 64
"""Largest number of cubes that are tested a second time, because the rays found no solid in them. The second
test follows lines along the normals of the surface."""

INSIDE = 0.5
"""Winding number above which a point is inside the solid."""

OWN_DISTANCE = 1e-6
"""A point counts as lying on a triangle if their distance is below this fraction of the size of the
surface."""

ROOT_DISTANCE = 0.2
"""A point of a limb counts as outside the cage if its distance from the cage exceeds this value [cells]."""

RAYS = 256
"""Largest number of rays in one measurement of a thickness."""

QUANTILE = 0.1
"""The thickness of a limb is this quantile of the lengths measured near the limb. The quantile is low because
the body next to the limb is thicker."""

CHUNK = 1 << 20
"""Number of pairs of a ray and a triangle that are processed at once."""


def points_on(corners: FloatArray, pitch: float) -> tuple[FloatArray, Ints]:
    """Sample points on triangles (m, 3, 3), at least one in each and at most about `pitch` [m] apart.

    Returns: points (k, 3) [m], and the triangle of each point, (k,).
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
    """Return the distance of each point from a mesh, (k,) [m]."""
    tet, weights = locator(points)
    nearest = np.einsum("kc,kci->ki", weights, mesh.vertices[mesh.tets[tet]])
    return np.asarray(np.linalg.norm(nearest - points, axis=1))


def _are_in(lattice: Lattice, points: FloatArray, cubes: Bools) -> Bools:
    return np.asarray(cubes[tuple(_cube_at(lattice, points).T)])


def _cube_at(lattice: Lattice, points: FloatArray) -> Ints:
    coordinates = ((points - lattice.origin) / lattice.edge).astype(np.int64)
    return np.clip(coordinates, 0, np.array(lattice.cubes) - 1)


def cubes_of(lattice: Lattice, points: FloatArray) -> Bools:
    """True for each cube of the lattice that contains a point."""
    occupied = np.zeros(lattice.cubes, dtype=np.bool_)
    occupied[tuple(_cube_at(lattice, points).T)] = True
    return occupied


@dataclass(frozen=True)
class Thin:
    """Approximate thickness of the thinnest limbs and sheets that are too thin for the requested cells [m].

    The thickness is infinite if there are no such parts.
    """

    kept: float  # thickness of the thinnest part that smaller cells keep
    lost: float  # thickness of the thinnest part that the cage leaves out
    octaves: int  # largest number of halvings of a cell

    def notes(self, cell_size: float) -> tuple[str, ...]:
        """Return messages about the limbs and sheets that are kept, and about those that are left out.

        A message is omitted if there are no such parts.
        Args: cell_size: requested edge of a cell [m].
        """
        notes = []
        if np.isfinite(self.kept):
            notes.append(
                f"limbs or sheets of about {self.kept:.2g} m are too thin for cells of {cell_size:.3g} m: "
                f"cells around them are {cell_size / 2**self.octaves:.3g} m, and substeps shorter by the "
                "same factor. refine=0 leaves them out"
            )
        if np.isfinite(self.lost):
            octaves = max(1, int(np.ceil(np.log2(cell_size / (MAX_ROD_RATIO * self.lost)))))
            notes.append(
                f"limbs or sheets of about {self.lost:.2g} m are left out, too thin for cells of "
                f"{cell_size:.3g} m: they are drawn, but neither bend nor collide. "
                f"cell_size={SAFE_ROD_RATIO * self.lost:.2g} keeps them"
                + (f", or refine={octaves}" if octaves <= MAX_REFINE else "")
            )
        return tuple(notes)


@dataclass(frozen=True, eq=False)
class MissedParts:
    """Parts of a surface that a cage should cover but does not."""

    cubes: Bools  # True for cubes with surface but no cage, and for cubes in which a limb leaves the cage
    bare: Bools  # True for cubes in `cubes` that contain no vertex of the cage
    thickness: FloatArray  # thickness of the limb or sheet in each cube [m]; infinity in other cubes
    points: FloatArray  # (k, 3), points of the surface in or next to `cubes` [m]

    @property
    def thinnest(self) -> float:
        """Smallest thickness of the missed parts [m]."""
        return float(self.thickness.min())

    def among(self, lattice: Lattice, cubes: Bools) -> MissedParts:
        """Return the missed parts in `cubes`, with the points in or next to these cubes."""
        points = self.points[_are_in(lattice, self.points, around(cubes))]
        return MissedParts(cubes, self.bare & cubes, np.where(cubes, self.thickness, np.inf), points)

    def joined(self, other: MissedParts) -> MissedParts:
        """Return the union with other missed parts."""
        return MissedParts(
            self.cubes | other.cubes,
            self.bare | other.bare,
            np.minimum(self.thickness, other.thickness),
            np.concatenate([self.points, other.points]),
        )


def far_points(lattice: Lattice, corners: FloatArray, mesh: TetMesh) -> tuple[FloatArray, Ints]:
    """Return points on the surface that a cage misses, (k, 3) [m], and the triangle of each point, (k,).

    Args:
        lattice: lattice of the requested cubes.
        corners: corners of the surface's triangles, (m, 3, 3) [m].
        mesh: the cage.
    """
    points, triangle = points_on(corners, PITCH * lattice.edge)
    # Test cubes first, because most surfaces then need no distances.
    is_missed = _are_in(lattice, points, ~cubes_of(lattice, mesh.vertices))
    if is_missed.any():
        is_missed[is_missed] = (
            _distances(Locator(mesh), mesh, points[is_missed]) > MISSED_DISTANCE * lattice.edge
        )
    return points[is_missed], triangle[is_missed]


def torn_points(solid: Solid, vertices: FloatArray, triangles: Ints) -> FloatArray:
    """Return points of the surface at gaps in the solid, (k, 3) [m].

    A gap separates components of the solid that the surface connects. Gaps appear if a limb is too thin for
    the voxels.
    Args:
        vertices: vertices of the surface, (n, 3) [m].
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
    """Return the points whose cube contains a part of the solid, (j, 3) [m].

    A wall without thickness is not solid.
    Args:
        points: points of the surface, (k, 3) [m].
        triangle: triangle of each point, (k,).
        corners: corners of all triangles, (m, 3, 3) [m].
    """
    is_solid = _are_in(lattice, points, cubes_of(lattice, solid.quadrature()[0]))
    # A needle along an axis can lie between all rays that found the solid.
    doubtful = np.flatnonzero(~is_solid)
    cubes = np.ravel_multi_index(tuple(_cube_at(lattice, points[doubtful]).T), lattice.cubes)
    order = np.random.default_rng(0).permutation(len(doubtful))
    sample = doubtful[order[np.unique(cubes[order], return_index=True)[1]]][:MAX_CUBES]
    near = corners[np.unique(triangle)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[triangle[sample]]
    directions = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    for point, direction in zip(points[sample], directions, strict=True):
        for distance in chords(point[None], direction[None], near):
            if (
                np.isfinite(distance)
                and abs(winding_number(point + 0.5 * distance * direction, corners)) > INSIDE
            ):
                here = cubes_of(lattice, point[None])
                is_solid |= _are_in(lattice, points, here)
    return points[is_solid]


def find_missed(lattice: Lattice, corners: FloatArray, mesh: TetMesh, far: FloatArray) -> MissedParts:
    """Find the missed parts at points far from a cage, and the limbs that connect these parts to the cage.

    Args:
        lattice, corners, mesh: arguments of `far_points`.
        far: points that `far_points` returned, at least one.
    """
    region = around(around(cubes_of(lattice, far)))
    points, triangle = points_on(corners, PITCH * lattice.edge)
    bare = cubes_of(lattice, points) & ~cubes_of(lattice, mesh.vertices) & region
    # A cube where a limb leaves the cage contains points of the limb and of the cage.
    roots = points[_are_in(lattice, points, around(bare) & ~bare)]
    cubes = bare | cubes_of(
        lattice, roots[_distances(Locator(mesh), mesh, roots) > ROOT_DISTANCE * lattice.edge]
    )
    near = corners[np.unique(triangle[_are_in(lattice, points, around(cubes))])]
    points, triangle = points_on(near, FINE_PITCH * lattice.edge)
    normals = np.cross(near[:, 1] - near[:, 0], near[:, 2] - near[:, 0])
    thicknesses, limbs = np.full(lattice.cubes, np.inf), parts_of(cubes.astype(np.float64))
    limb, in_bare = limbs[tuple(_cube_at(lattice, points).T)], _are_in(lattice, points, bare)
    for number in range(int(limbs.max()) + 1):
        in_limb = (limb == number) & in_bare
        thicknesses[limbs == number] = thickness(points[in_limb], normals[triangle[in_limb]], near)
    bins = np.floor(points / (FINE_PITCH * lattice.edge))
    points = points[np.unique(bins, axis=0, return_index=True)[1]]
    return MissedParts(cubes, bare, thicknesses, points[_are_in(lattice, points, around(cubes))])


def thickness(points: FloatArray, normals: FloatArray, corners: FloatArray) -> float:
    """Measure the thickness of the solid that triangles enclose, along the normals at some points [m].

    Args:
        points: points on the triangles, (k, 3) [m].
        normals: normals at the points, (k, 3), of any length.
        corners: corners of the triangles, (m, 3, 3) [m].
    Returns: the thickness; infinity if no normal meets another triangle.
    """
    sample = np.unique(np.linspace(0, len(points) - 1, min(RAYS, len(points))).astype(np.int64))
    lengths = np.linalg.norm(normals[sample], axis=1, keepdims=True)
    lengths_found = np.abs(
        chords(points[sample], normals[sample] / np.where(lengths > 0.0, lengths, 1.0), corners)
    )
    lengths_found = lengths_found[np.isfinite(lengths_found)]
    return float(np.quantile(lengths_found, QUANTILE)) if len(lengths_found) else np.inf


def chords(points: FloatArray, directions: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the signed distance from each point along a line to the nearest other triangle, (k,) [m].

    The distance is negative if the triangle lies behind the point, and infinite if the line meets no
    triangle.
    Args:
        points: points on triangles, (k, 3) [m].
        directions: directions of the lines, (k, 3), of length 1.
        corners: corners of the triangles, (m, 3, 3) [m].
    """
    own = OWN_DISTANCE * float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    nearest = np.full(len(points), np.inf)
    rows = max(1, CHUNK // len(corners))
    for start in range(0, len(points), rows):
        batch = slice(start, start + rows)
        distance = _intersections(points[batch], directions[batch], corners)
        size = np.where(np.abs(distance) > own, np.abs(distance), np.inf)
        best = size.argmin(axis=1)
        each = np.arange(len(best))
        nearest[batch] = np.where(np.isfinite(size[each, best]), distance[each, best], np.inf)
    return nearest


def _intersections(points: FloatArray, directions: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the signed distance along each line to each triangle, (k, m) [m]; NaN if the line misses it.

    Möller and Trumbore, "Fast, minimum storage ray/triangle intersection" (1997).
    """
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(directions[:, None], other)
    det = np.einsum("kmi,mi->km", p, one)
    from_corner = points[:, None] - corners[:, 0]
    q = np.cross(from_corner, one)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("kmi,kmi->km", p, from_corner) / det
        v = np.einsum("kmi,ki->km", q, directions) / det
        distance = np.einsum("kmi,mi->km", q, other) / det
        return np.where((u >= 0.0) & (v >= 0.0) & (u + v <= 1.0), distance, np.nan)
