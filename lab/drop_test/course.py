"""Random courses: a closed room with solid obstacles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lab.drop_test import distances
from lab.drop_test.distances import Distance
from taichi_soft import (
    BoxShape,
    CapsuleShape,
    HeightFieldShape,
    MeshShape,
    PlaneShape,
    Shape,
    SphereShape,
    torus,
)
from taichi_soft.core.math.rotations import matrix_of

Floats = NDArray[np.float64]

HALF, HEIGHT, BELOW = 3.0, 8.0, 3.0
"""Half the width of the room, height of its lid, and depth of its walls below the floor [sizes of the
body]."""

THINNEST = 0.02
"""Smallest thickness of walls, lids and floors [m]."""

STEEPEST = 0.35
"""Largest angle of a tilted floor [rad]."""

CELLS = 24
"""Number of grid cells along the longest side of a mesh collider."""


@dataclass(frozen=True)
class Solid:
    """A collider, and an independent formula for the signed distance from its surface."""

    name: str
    shape: Shape
    distance: Distance  # maps points in the solid's axes; negative inside a solid or outside the room
    tolerance: float  # depth up to which a point counts as lying on the surface [m]
    is_room: bool  # True for floor, walls and lid; bodies must not pass through them
    position: Floats
    rotation: Floats  # (3, 3)
    friction: float
    restitution: float | None

    def depth(self, points: Floats) -> float:
        """Return the largest depth of points (n, 3) in the solid [m]; negative if all points are outside."""
        return -float(self.distance((points - self.position) @ self.rotation).min())


def random_rotation(rng: np.random.Generator) -> Floats:
    """Return a uniformly distributed random rotation matrix (3, 3)."""
    quaternion = rng.normal(size=4)
    matrix: Floats = matrix_of(quaternion / np.linalg.norm(quaternion))
    return matrix


def make_course(rng: np.random.Generator, size: float) -> tuple[Solid, ...]:
    """Make a room with one to four obstacles in its lower half.

    The room is 6 x 6 x 8 sizes of the body. With probability 1/2, the solids leave the bodies' restitution
    unchanged.
    """
    friction, restitution = rng.uniform(0.2, 1.0), rng.choice([0.0, rng.uniform(0.0, 0.9)])
    surface = {"friction": float(friction), "restitution": float(restitution) or None}
    room = [_floor(rng, size, surface), *_walls(rng, size, surface)]
    return (*room, *(_obstacle(rng, size, surface) for _ in range(rng.integers(1, 5))))


def _solid(  # type: ignore[no-untyped-def]
    name: str,
    shape: Shape,
    distance: Distance,
    tolerance: float,
    surface,
    is_room=False,
    position=None,
    turn=None,
) -> Solid:
    where = np.zeros(3) if position is None else np.asarray(position, dtype=np.float64)
    return Solid(
        name, shape, distance, tolerance, is_room, where, np.eye(3) if turn is None else turn, **surface
    )


def _floor(rng: np.random.Generator, size: float, surface: dict[str, float | None]) -> Solid:
    on = 1e-4 + 1e-3 * size
    kind = rng.choice(["plane", "slab", "tilted plane", "height field"], p=[0.3, 0.2, 0.25, 0.25])
    if kind == "slab":
        thick = _thickness(rng, size)
        edges = np.array([2 * HALF * size + 1.0, 2 * HALF * size + 1.0, thick])
        place = (0.0, 0.0, -thick / 2)
        above = distances.half_space(np.array([0.0, 0.0, 1.0]), thick / 2)
        return _solid("slab", BoxShape(edges), above, on, surface, True, place)
    if kind == "height field":
        spacing = size * rng.uniform(0.4, 1.0)
        nodes = int(np.ceil(2 * HALF * size / spacing)) + 3
        heights = size * rng.uniform(-0.3, 0.0, (nodes, nodes))
        shape = HeightFieldShape(heights, spacing)
        return _solid("height field", shape, distances.ground(heights, spacing), on, surface, True)
    normal = np.array([0.0, 0.0, 1.0])
    if kind == "tilted plane":
        angle, way = rng.uniform(0.0, STEEPEST), rng.uniform(0.0, 2 * np.pi)
        normal = np.array([np.sin(angle) * np.cos(way), np.sin(angle) * np.sin(way), np.cos(angle)])
    return _solid(str(kind), PlaneShape(normal), distances.half_space(normal), on, surface, True)


def _thickness(rng: np.random.Generator, size: float) -> float:
    return float(rng.choice([THINNEST, max(THINNEST, rng.uniform(0.0, 0.5) * size)]))


def _walls(rng: np.random.Generator, size: float, surface: dict[str, float | None]) -> list[Solid]:
    thick, on = _thickness(rng, size), 1e-4 + 1e-3 * size
    wide, tall = 2 * HALF * size + 2 * thick, (HEIGHT + BELOW) * size
    middle = (HEIGHT - BELOW) / 2 * size
    walls = []
    for axis in (0, 1):
        edges = np.array([wide, wide, tall])
        edges[axis] = thick
        for side in (-1.0, 1.0):
            place = np.array([0.0, 0.0, middle])
            place[axis] = side * (HALF * size + thick / 2)
            inwards = distances.half_space(-side * np.eye(3)[axis], thick / 2)
            walls.append(_solid("wall", BoxShape(edges), inwards, on, surface, True, place))
    edges = np.array([wide, wide, thick])
    place = np.array([0.0, 0.0, HEIGHT * size + thick / 2])
    below = distances.half_space(np.array([0.0, 0.0, -1.0]), thick / 2)
    return [*walls, _solid("lid", BoxShape(edges), below, on, surface, True, place)]


def _obstacle(rng: np.random.Generator, size: float, surface: dict[str, float | None]) -> Solid:
    kind = rng.choice(["box", "sphere", "capsule", "mesh"])
    on = 1e-4 + 1e-2 * size
    place = size * np.array([*rng.uniform(-2.0, 2.0, 2), rng.uniform(0.0, 3.0)])
    turn = random_rotation(rng)
    if kind == "box":
        edges = size * rng.uniform(0.3, 1.5, 3)
        return _solid("box", BoxShape(edges), distances.cuboid(edges), on, surface, False, place, turn)
    radius = float(size * rng.uniform(0.3, 0.8))
    if kind == "sphere":
        return _solid("sphere", SphereShape(radius), distances.ball(radius), on, surface, False, place, turn)
    if kind == "capsule":
        length = float(size * rng.uniform(0.3, 2.0))
        shape = CapsuleShape(0.6 * radius, length)
        distance = distances.capsule(0.6 * radius, length)
        return _solid("capsule", shape, distance, on, surface, False, place, turn)
    minor = radius * float(rng.uniform(0.35, 0.6))
    cell = 2 * (radius + minor) / CELLS
    ring = MeshShape(torus(radius, minor, rings=3, segments=24), cell=cell, cache=False)
    return _solid("mesh", ring, distances.ring(radius, minor), on + cell, surface, False, place, turn)
