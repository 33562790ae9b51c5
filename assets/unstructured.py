"""Connect scattered points to tetrahedra by Delaunay's rule, and move points to improve the worst angles."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.spatial import Delaunay

from taichi_soft.meshing.quality import measure_quality
from taichi_soft.meshing.tet_mesh import TetMesh
from taichi_soft.meshing.topology import LOCAL_FACES, surface_of

# Smallest dihedral angle of a tetrahedron whose corners all lie on the surface [degrees]. Tetrahedra with a
# smaller angle can be removed, because they lie flat in the surface.
HULL_SLIVER = 4.0


@dataclass
class Cloud:
    """Points and their constraints. A constraint is NaN for a free point.

    Attributes:
        points: positions, (n, 3).
        sphere: prescribed distance of each point from the origin, (n,).
        radius: prescribed distance of each point from the z axis, (n,).
        height: prescribed z of each point, (n,).
    """

    points: np.ndarray
    sphere: np.ndarray
    radius: np.ndarray
    height: np.ndarray

    def is_held(self) -> np.ndarray:
        """Return True for each point that must stay on the surface, (n,)."""
        return ~(np.isnan(self.sphere) & np.isnan(self.radius) & np.isnan(self.height))

    def held(self, index: int, point: np.ndarray) -> np.ndarray:
        """Move a position, (3,), so that it satisfies the constraints of point `index`, and return it."""
        point = point.copy()
        if self.sphere[index] == self.sphere[index]:
            point *= self.sphere[index] / np.linalg.norm(point)
        if self.radius[index] == self.radius[index]:
            point[:2] *= self.radius[index] / np.hypot(*point[:2])
        if self.height[index] == self.height[index]:
            point[2] = self.height[index]
        return point


def spread_on_sphere(count: int, seed: int, steps: int = 300) -> np.ndarray:
    """Spread points on the unit sphere by mutual repulsion (Thomson's problem). Returns: (count, 3)."""
    index = np.arange(count) + 0.5
    latitude, longitude = np.arccos(1 - 2 * index / count), np.pi * (1 + np.sqrt(5)) * index
    points = np.column_stack(
        [np.cos(longitude) * np.sin(latitude), np.sin(longitude) * np.sin(latitude), np.cos(latitude)]
    )
    points += np.random.default_rng(seed).normal(scale=0.3 / np.sqrt(count), size=points.shape)
    points /= np.linalg.norm(points, axis=1)[:, None]
    spacing = np.sqrt(4 * np.pi / count)
    for step in range(steps):
        apart = points[:, None] - points
        distance = np.linalg.norm(apart, axis=2)
        np.fill_diagonal(distance, np.inf)
        force = (apart / distance[:, :, None] ** 4).sum(axis=1) * spacing**3
        force -= np.einsum("ij,ij->i", force, points)[:, None] * points
        length = np.maximum(1.0, np.linalg.norm(force, axis=1))[:, None]
        points += 0.1 * spacing * (1 - step / steps) * force / length
        points /= np.linalg.norm(points, axis=1)[:, None]
    return points


def triangulate(cloud: Cloud, sliver: float = HULL_SLIVER) -> np.ndarray:
    """Return Delaunay tetrahedra of positive volume, without flat tetrahedra on the surface, (m, 4)."""
    points = cloud.points
    tets = Delaunay(points).simplices.astype(np.int64)
    a, b, c = (points[tets[:, i]] - points[tets[:, 0]] for i in (1, 2, 3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    tets[volume < 0] = tets[volume < 0][:, [0, 1, 3, 2]]
    tets = tets[volume != 0]
    outside = cloud.is_held()
    while True:
        flat = np.flatnonzero(
            (measure_quality(points, tets).min_dihedral < sliver) & outside[tets].all(axis=1)
        )
        surface = set(map(tuple, np.sort(surface_of(tets), axis=1).tolist()))
        drop = [t for t in flat if any(f in surface for f in combinations(sorted(tets[t].tolist()), 3))]
        if not drop:
            return tets
        tets = np.delete(tets, drop, axis=0)


def worth(points: np.ndarray, tets: np.ndarray, angle_per_height: float) -> np.ndarray:
    """Return the score of each tetrahedron, (m,).

    The score is the smallest dihedral angle [degrees], or the weighted smallest height if this is less. The
    height limits the time step. Its weight is `angle_per_height` degrees per metre. Inverted tetrahedra have
    the score -1.
    """
    corners = points[tets]
    faces = corners[:, LOCAL_FACES]
    areas = 0.5 * np.linalg.norm(
        np.cross(faces[:, :, 1] - faces[:, :, 0], faces[:, :, 2] - faces[:, :, 0]), axis=2
    )
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    height = 3 * volume / areas.max(axis=1)
    score: np.ndarray = np.minimum(measure_quality(points, tets).min_dihedral, angle_per_height * height)
    return np.where(volume > 0, score, -1.0)


def polish(cloud: Cloud, tets: np.ndarray, seed: int, trials: int, angle_per_height: float) -> None:
    """Move points of the worst tetrahedra at random.

    A move is kept if it raises the worst score of the tetrahedra around the point.
    """
    random = np.random.default_rng(seed)
    around = [np.flatnonzero((tets == vertex).any(axis=1)) for vertex in range(len(cloud.points))]
    score = worth(cloud.points, tets, angle_per_height)
    scale = np.full(len(cloud.points), 0.1)
    size = np.cbrt(6 * TetMesh(cloud.points, tets).volumes)
    for _ in range(trials):
        vertex = int(random.choice(tets[random.choice(np.argpartition(score, 12)[:12])]))
        own = around[vertex]
        before = cloud.points[vertex].copy()
        step = random.normal(size=3) * scale[vertex] * size[own].mean()
        cloud.points[vertex] = cloud.held(vertex, before + step)
        after = worth(cloud.points, tets[own], angle_per_height)
        if after.min() > score[own].min():
            score[own] = after
            scale[vertex] = min(0.3, scale[vertex] * 1.5)
        else:
            cloud.points[vertex] = before
            scale[vertex] = max(0.003, scale[vertex] * 0.95)
