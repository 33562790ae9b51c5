"""Meshes and materials that several scenes use."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft import Material, SpringMaterial, TetMesh, box

JELLY = Material(young=1e5, poisson=0.4, density=1000.0)
RUBBER = Material(young=1e6, poisson=0.4, density=1000.0)
FIRM = Material(young=2e7, poisson=0.3, density=500.0)
CORD = SpringMaterial(stiffness=2000.0, damping=0.5)


def rotation(axis: ArrayLike, degrees: float) -> NDArray[np.float64]:
    """Return the quaternion (x, y, z, w) of a rotation about an axis."""
    direction = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    half = np.radians(degrees) / 2
    return np.append(np.sin(half) * direction, np.cos(half))


def turned(mesh: TetMesh, axis: ArrayLike, degrees: float) -> TetMesh:
    """Return a copy of a mesh, rotated about an axis through the origin."""
    x, y, z, w = rotation(axis, degrees)
    matrix = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    return TetMesh(mesh.vertices @ matrix.T, mesh.tets)


def bar(cells: int = 5) -> TetMesh:
    """Return a bar of 1.2 m along x whose square section of 0.1 m stands on a corner, 0.141 m high."""
    return turned(box((1.2, 0.1, 0.1), (cells, 1, 1)), (1, 0, 0), 45.0)


def union(*meshes: TetMesh) -> TetMesh:
    """Return one mesh of several meshes. Vertices at the same place become one."""
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    tets = np.concatenate([mesh.tets + start for mesh, start in zip(meshes, starts, strict=False)])
    _, first, which = np.unique(np.round(vertices, 6), axis=0, return_index=True, return_inverse=True)
    return TetMesh(vertices[first], which.ravel()[tets])


def moved(mesh: TetMesh, offset: ArrayLike) -> TetMesh:
    """Return a copy of a mesh, displaced by `offset` [m]."""
    return TetMesh(mesh.vertices + np.asarray(offset, dtype=float), mesh.tets)


def product(q: ArrayLike, r: ArrayLike) -> NDArray[np.float64]:
    """Return the quaternion of rotation `r` followed by rotation `q`."""
    x, y, z, w = np.asarray(q, dtype=float)
    a, b, c, d = np.asarray(r, dtype=float)
    return np.array(
        [
            w * a + x * d + y * c - z * b,
            w * b - x * c + y * d + z * a,
            w * c + x * b - y * a + z * d,
            w * d - x * a - y * b - z * c,
        ]
    )
