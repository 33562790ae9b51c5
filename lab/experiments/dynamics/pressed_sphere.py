"""Press an elastic sphere, clamped at its cap, onto a rigid plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft import Material, PlaneShape, TetMesh, internal_forces, sphere
from taichi_soft.core.types import LawName
from taichi_soft.world.bare import bare_world

Floats = NDArray[np.float64]

RADIUS = 0.5  # [m]
MATERIAL = Material(young=1e6, poisson=0.3, density=1000.0, damping_ratio=0.0)
GRADED = 0.6
"""Strength of the refinement towards the lowest point. At 0.6, edges near that point are (1 - 0.6) / (1 +
0.6) = 1/4 as long."""
DEPTHS = (0.005, 0.01, 0.02, 0.04)  # [radius]
FRICTIONLESS, BRAKE = 0.0, 100.0  # friction, damping rate [1/s]
DT, LOWERING, RESTING = 0.005, 10, 30  # step [s]; number of steps to reach a depth, number of steps there


def hertz_force(depth: float) -> float:
    """Return Hertz's force 4/3 E* sqrt(R) d^(3/2) at a depth d [N]."""
    modulus = float(np.unique(MATERIAL.young)[0]) / (1 - float(np.unique(MATERIAL.poisson)[0]) ** 2)
    return float(4 / 3 * modulus * np.sqrt(RADIUS) * depth**1.5)


def graded_sphere(resolution: int, grading: float) -> TetMesh:
    """Make a ball with smaller tetrahedra near its lowest point.

    A Moebius map of the ball onto itself moves the vertices down. The map preserves spheres and angles.
    """
    ball = sphere(1.0, resolution)
    x, a = ball.vertices, np.array([0.0, 0.0, -grading])
    square, along = (x**2).sum(axis=1)[:, None], (x @ a)[:, None]
    drawn = (1 + 2 * along + square) * a + (1 - grading**2) * x
    return TetMesh(RADIUS * drawn / (1 + 2 * along + grading**2 * square), ball.tets)


def cap(mesh: TetMesh) -> NDArray[np.int64]:
    """Return the indices of the fixed vertices: those more than half a radius above the centre."""
    return np.flatnonzero(mesh.vertices[:, 2] > 0.5 * RADIUS)


def press_on_floor(mesh: TetMesh, law: LawName) -> list[float]:
    """Return the force that holds the cap after lowering it by each depth [N].

    The forces are computed in float64 from the positions.
    """
    held, ground = cap(mesh), float(mesh.vertices[:, 2].min())
    world = bare_world(gravity=(0, 0, 0), floor=ground, friction=FRICTIONLESS, retries=0)
    body = world.add_body(mesh, MATERIAL, law=law, pinned=held)
    world.build()
    body.set_linear_damping(BRAKE)
    substeps = 2 * world.stable_substeps(DT)
    forces = list[float]()
    for ways in _descent():
        for way in ways:
            body.set_targets(held, mesh.vertices[held] - (0.0, 0.0, way))
            world.step(DT, substeps)
        pulls = internal_forces(mesh, MATERIAL, body.positions().astype(np.float64), law=law)
        forces.append(float(pulls[held, 2].sum()))
    return forces


def press_plane(mesh: TetMesh, law: LawName) -> list[float]:
    """Return the force on a plane after the plane is raised by each depth [N].

    The forces are computed from the impulse on the plane.
    """
    ground = float(mesh.vertices[:, 2].min())
    world = bare_world(gravity=(0, 0, 0), floor=None, retries=0)
    body = world.add_body(mesh, MATERIAL, law=law, pinned=cap(mesh))
    plane = world.add_collider(PlaneShape((0, 0, 1)), position=(0, 0, ground), friction=FRICTIONLESS)
    world.build()
    body.set_linear_damping(BRAKE)
    substeps = 2 * world.stable_substeps(DT)
    forces = list[float]()
    for ways in _descent():
        for way in ways:
            plane.move_to((0, 0, ground + way))
            world.step(DT, substeps)
        forces.append(-float(plane.impulse[2]) / DT)
    return forces


def _descent() -> list[list[float]]:
    """Return the depth after each step [m], as one list for each of `DEPTHS`.

    The values of a list approach its depth and then stay constant.
    """
    starts = (0.0, *DEPTHS[:-1])
    return [
        [
            RADIUS * (start + min(1.0, (step + 1) / LOWERING) * (depth - start))
            for step in range(LOWERING + RESTING)
        ]
        for start, depth in zip(starts, DEPTHS, strict=True)
    ]
