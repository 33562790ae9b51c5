"""Irregular meshes like those of users, made from seeded random points.

There are bodies with slivers, graded bodies, plates, rods and letters.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from taichi_soft import TetMesh, extrude
from taichi_soft.meshing.delaunay import scipy_spatial

Floats = NDArray[np.float64]
Loops = tuple[tuple[tuple[float, float], ...], ...]
"""Outlines (x, y) of a flat figure, filled by the even-odd rule."""

FLATTEST_OUTSIDE = 0.002
"""Smallest ratio of a tetrahedron's volume to the cube of its longest edge, for tetrahedra at the surface. A
regular tetrahedron has the ratio 0.118. `delaunay_body` removes flatter tetrahedra at the surface, as meshers
do, and keeps flat ones inside the body."""


def spread_points(rng: np.random.Generator, candidates: Floats, spacing: Floats | float) -> Floats:
    """Choose points at a minimum distance from each other, in random order.

    Args:
        candidates: (n, d) points to choose from [m].
        spacing: smallest distance of each candidate from all points chosen before it, (n,) or one number [m].
    """
    order = rng.permutation(len(candidates))
    points, gaps = candidates[order], np.broadcast_to(spacing, len(candidates))[order]
    taken = np.zeros(len(points), dtype=bool)
    for k, point in enumerate(points):
        taken[k] = not taken.any() or ((points[taken] - point) ** 2).sum(axis=1).min() > gaps[k] ** 2
    return points[taken]


def delaunay_body(points: Floats) -> TetMesh:
    """Return the Delaunay mesh of (n, 3) points [m], without flat tetrahedra at its surface."""
    tets = np.asarray(scipy_spatial("foreign meshes").Delaunay(points).simplices, dtype=np.int64)
    x = points[tets]
    volumes = np.abs(np.linalg.det(x[:, 1:] - x[:, :1])) / 6
    longest = np.linalg.norm(x[:, :, None] - x[:, None], axis=3).max(axis=(1, 2))
    is_flat = volumes < FLATTEST_OUTSIDE * longest**3
    while True:
        faces = np.sort(tets[:, [(1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)]], axis=2).reshape(-1, 3)
        _, which, counts = np.unique(faces, axis=0, return_inverse=True, return_counts=True)
        is_outer = (counts[which.reshape(-1)] == 1).reshape(-1, 4).any(axis=1)
        peeled = is_flat & is_outer
        if not peeled.any():
            break
        tets, is_flat = tets[~peeled], is_flat[~peeled]
    used, corners = np.unique(tets, return_inverse=True)
    vertices = points[used] - (points[used].min(axis=0) + points[used].max(axis=0)) / 2
    return TetMesh(vertices, corners.reshape(-1, 4), fix_orientation=True)


def ball_cloud(size: float, count: int, spacing: float, seed: int) -> TetMesh:
    """Mesh random points in a ball. Points are at least `spacing` times the ball's diameter apart."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.5, 0.5, (8 * count, 3))
    points = points[np.linalg.norm(points, axis=1) < 0.5][:count]
    return delaunay_body(size * spread_points(rng, points, spacing))


def box_cloud(size: tuple[float, float, float], count: int, seed: int, spacing: float = 0.0) -> TetMesh:
    """Mesh the corners of a box and random points inside it, at least `spacing` [m] apart."""
    rng = np.random.default_rng(seed)
    corners = np.array([(i & 1, i >> 1 & 1, i >> 2) for i in range(8)], dtype=np.float64)
    points = np.concatenate([corners, rng.uniform(size=(count, 3))]) * size
    return delaunay_body(spread_points(rng, points, spacing))


def shell_cloud(size: float, count: int, seed: int) -> TetMesh:
    """Mesh evenly spread points on a sphere and a few random points inside.

    Meshers that cannot refine the surface make similar meshes.
    """
    rng = np.random.default_rng(seed)
    k = np.arange(count) + 0.5
    height, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    across = np.sqrt(1 - height**2)
    outside = np.column_stack([across * np.cos(turn), across * np.sin(turn), height])
    inside = rng.uniform(-0.6, 0.6, (count // 3, 3))
    return delaunay_body(size / 2 * np.concatenate([outside, inside]))


def sliver_lattice(size: float, cells: int, jitter: float, seed: int) -> TetMesh:
    """Mesh a cubic lattice whose points are moved at random, by up to `jitter` cells along each axis.

    The corners of a cell's face lie almost in a plane and on a circle, so Delaunay's rule joins many of these
    corners into slivers.
    """
    rng = np.random.default_rng(seed)
    points = np.indices((cells + 1,) * 3).reshape(3, -1).T + rng.uniform(
        -jitter, jitter, ((cells + 1) ** 3, 3)
    )
    return delaunay_body(size / cells * points)


def graded_box(size: float, count: int, ratio: float, seed: int) -> TetMesh:
    """Mesh a cube. Edges of tetrahedra are `ratio` times longer in one corner than in the opposite corner."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(size=(40 * count, 3)) ** (1 + np.log10(ratio))
    away = np.linalg.norm(points, axis=1) / 3**0.5
    gaps = 1.4 * count ** (-1 / 3) * (1 / ratio + (1 - 1 / ratio) * away)
    corners = np.array([(i & 1, i >> 1 & 1, i >> 2) for i in range(8)], dtype=np.float64)
    return delaunay_body(size * np.concatenate([corners, spread_points(rng, points, gaps)]))


def flat_body(
    loops: Loops, size: float, thickness: float, layers: int, spacing: float, seed: int, inside: float = 1.0
) -> TetMesh:
    """Triangulate a flat figure irregularly, and extrude it to a body of the given `thickness` [m].

    Args:
        size: longest side of the figure [m].
        spacing: distance between points on the outline, as a fraction of `size`.
        inside: distance between points inside the outline, as a multiple of `spacing`.
    """
    rng = np.random.default_rng(seed)
    outline = [np.asarray(loop, dtype=np.float64) for loop in loops]
    low = np.min([loop.min(axis=0) for loop in outline], axis=0)
    scale = np.max([np.ptp(loop, axis=0).max() for loop in outline])
    outline = [(loop - low) / scale for loop in outline]
    rim = np.concatenate([_along(loop, spacing) for loop in outline])
    candidates = rng.uniform(size=(int(12 / (spacing * inside) ** 2), 2))
    candidates = candidates[_is_inside(candidates, outline)]
    far = scipy_spatial("foreign meshes").cKDTree(rim).query(candidates)[0] > 0.6 * spacing
    points = np.concatenate([rim, spread_points(rng, candidates[far], spacing * inside)])
    triangles = np.asarray(scipy_spatial("foreign meshes").Delaunay(points).simplices, dtype=np.int64)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    triangles = triangles[_is_inside((a + b + c) / 3, outline) & (area > 1e-3 * spacing**2)]
    used, corners = np.unique(triangles, return_inverse=True)
    return extrude(size * points[used], corners.reshape(-1, 3), layers, thickness)


def _along(loop: Floats, spacing: float) -> Floats:
    """Return points (n, 2) on a closed outline, about `spacing` apart, including its corners."""
    sides = zip(loop, np.roll(loop, -1, axis=0), strict=True)
    return np.concatenate(
        [
            np.linspace(a, b, max(1, round(float(np.linalg.norm(b - a)) / spacing)), endpoint=False)
            for a, b in sides
        ]
    )


def _is_inside(points: Floats, outline: list[Floats]) -> NDArray[np.bool_]:
    """Return True for each of the points (n, 2) that lies inside the outline, (n,).

    A ray from such a point to the right crosses the outline an odd number of times.
    """
    crossings = np.zeros(len(points), dtype=np.int64)
    for loop in outline:
        for a, b in zip(loop, np.roll(loop, -1, axis=0), strict=True):
            if a[1] != b[1]:
                is_beside = (a[1] > points[:, 1]) != (b[1] > points[:, 1])
                at = a[0] + (points[:, 1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
                crossings += is_beside & (points[:, 0] < at)
    return np.asarray(crossings % 2 == 1)


def _star(spikes: int, waist: float) -> Loops:
    angle = np.pi * np.arange(2 * spikes) / spikes
    radius = np.where(np.arange(2 * spikes) % 2, waist, 1.0)
    return (tuple(zip((radius * np.sin(angle)).tolist(), (radius * np.cos(angle)).tolist(), strict=True)),)


_SQUARE: Loops = (((0, 0), (1, 0), (1, 1), (0, 1)),)
_LETTERS: dict[str, Loops] = {
    "A": (
        ((0, 0), (1, 0), (1.7, 2), (3.3, 2), (4, 0), (5, 0), (3, 6), (2, 6)),
        ((2, 2.8), (3, 2.8), (2.5, 4.6)),
    ),
    "B": (
        ((0, 0), (3, 0), (4, 1), (4, 2.5), (3.4, 3), (4, 3.5), (4, 5), (3, 6), (0, 6)),
        ((1, 1), (2.8, 1), (3, 1.3), (3, 2.2), (2.8, 2.5), (1, 2.5)),
        ((1, 3.5), (2.8, 3.5), (3, 3.8), (3, 4.7), (2.8, 5), (1, 5)),
    ),
    "E": (
        (
            (0, 0),
            (4, 0),
            (4, 1),
            (1, 1),
            (1, 2.5),
            (3, 2.5),
            (3, 3.5),
            (1, 3.5),
            (1, 5),
            (4, 5),
            (4, 6),
            (0, 6),
        ),
    ),
    "H": (
        (
            (0, 0),
            (1, 0),
            (1, 2.5),
            (3, 2.5),
            (3, 0),
            (4, 0),
            (4, 6),
            (3, 6),
            (3, 3.5),
            (1, 3.5),
            (1, 6),
            (0, 6),
        ),
    ),
    "N": (((0, 0), (1, 0), (1, 4), (3, 0), (4, 0), (4, 6), (3, 6), (3, 2), (1, 6), (0, 6)),),
    "O": (
        ((1, 0), (3, 0), (4, 1), (4, 5), (3, 6), (1, 6), (0, 5), (0, 1)),
        ((1.3, 1), (2.7, 1), (3, 1.3), (3, 4.7), (2.7, 5), (1.3, 5), (1, 4.7), (1, 1.3)),
    ),
    "T": (((1.5, 0), (2.5, 0), (2.5, 5), (4, 5), (4, 6), (0, 6), (0, 5), (1.5, 5)),),
    "X": (
        (
            (0, 0),
            (1.2, 0),
            (2, 2),
            (2.8, 0),
            (4, 0),
            (2.6, 3),
            (4, 6),
            (2.8, 6),
            (2, 4),
            (1.2, 6),
            (0, 6),
            (1.4, 3),
        ),
    ),
}

Maker = Callable[[], TetMesh]

FOREIGN_MESHES: dict[str, Maker] = {
    **{
        f"ball of {count} points, {size:g} m": partial(ball_cloud, size, count, spacing, seed)
        for seed, (size, count, spacing) in enumerate(
            [
                (0.1, 150, 0.12),
                (0.3, 400, 0.08),
                (1.0, 400, 0.0),
                (1.0, 900, 0.06),
                (10.0, 700, 0.05),
                (0.01, 80, 0.15),
            ]
        )
    },
    **{
        f"box of {count} points, {size[0]:g} m": partial(box_cloud, size, count, seed)
        for seed, (size, count) in enumerate(
            [
                ((0.3, 0.2, 0.2), 60),
                ((1, 1, 1), 120),
                ((1, 0.5, 0.25), 250),
                ((3, 2, 1), 500),
                ((10, 10, 5), 400),
            ]
        )
    },
    **{
        f"shell of {count} points, {size:g} m": partial(shell_cloud, size, count, seed)
        for seed, (size, count) in enumerate([(0.1, 60), (0.5, 120), (1.0, 250), (3.0, 400)])
    },
    **{
        f"lattice with slivers {jitter:g}, {size:g} m": partial(sliver_lattice, size, cells, jitter, seed)
        for seed, (size, cells, jitter) in enumerate(
            [(1.0, 5, 0.3), (1.0, 5, 0.1), (1.0, 4, 0.03), (1.0, 6, 0.01), (3.0, 5, 0.003), (0.2, 4, 0.1)]
        )
    },
    **{
        f"graded 1 to {ratio:g}, {size:g} m": partial(graded_box, size, count, ratio, seed)
        for seed, (size, count, ratio) in enumerate(
            [
                (0.5, 100, 5.0),
                (1.0, 100, 10.0),
                (1.0, 150, 20.0),
                (3.0, 150, 30.0),
                (10.0, 150, 100.0),
                (0.2, 60, 5.0),
            ]
        )
    },
    **{
        f"letter {name}, {size:g} m": partial(flat_body, loops, size, thickness * size, layers, spacing, seed)
        for seed, ((name, loops), (size, thickness, layers, spacing)) in enumerate(
            zip(
                _LETTERS.items(),
                [
                    (1.0, 0.2, 2, 0.07),
                    (1.0, 0.15, 2, 0.06),
                    (0.1, 0.2, 1, 0.12),
                    (0.3, 0.1, 1, 0.08),
                    (3.0, 0.3, 3, 0.08),
                    (1.0, 0.05, 1, 0.05),
                    (0.05, 0.25, 1, 0.17),
                    (10.0, 0.2, 2, 0.06),
                ],
                strict=True,
            )
        )
    },
    "star of 5, 1 m": partial(flat_body, _star(5, 0.4), 1.0, 0.2, 2, 0.08, 1),
    "star of 8, 0.3 m": partial(flat_body, _star(8, 0.6), 0.3, 0.06, 1, 0.1, 2),
    "star of 12, 2 m": partial(flat_body, _star(12, 0.3), 2.0, 0.2, 1, 0.05, 3),
    "sparse star of 6, 1 m": partial(flat_body, _star(6, 0.5), 1.0, 0.3, 3, 0.06, 4, 3.0),
    **{
        f"plate 1:{round(1 / thinness)}, {size:g} m": partial(
            flat_body, _SQUARE, size, thinness * size, 1, spacing, seed
        )
        for seed, (size, thinness, spacing) in enumerate(
            [(1.0, 0.05, 0.08), (1.0, 0.02, 0.06), (2.0, 0.01, 0.05), (0.3, 0.03, 0.1), (5.0, 0.005, 0.06)]
        )
    },
    **{
        f"rod 1:{round(length / width)}, {length:g} m": partial(
            box_cloud, (length, width, width), count, seed, 0.5 * width
        )
        for seed, (length, width, count) in enumerate(
            [(1.0, 0.05, 900), (1.0, 0.02, 2500), (3.0, 0.1, 1500), (0.3, 0.03, 500), (10.0, 0.2, 2500)]
        )
    },
}
"""Functions that make the 49 meshes, by name. The smallest dihedral angles of the meshes are 0.02 to 20
degrees. `python -m lab drop-test --sweep` lists these angles."""
