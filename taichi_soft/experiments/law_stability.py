"""How stable a body is under a law: by its vibrations at rest, and by running it."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from taichi_soft import FrozenBodyWarning, Material, TetMesh, UnstableStepWarning, World, internal_forces

STEPS = 200
GROWTH = 3.0
"""Of a small random displacement within `STEPS` that counts as unstable."""

SHORTEST, LONGEST, HALVINGS = 0.25, 1.4, 7
"""Bounds of the search for the largest step, over a guess, and how often the gap is halved: to 1 %."""


@dataclass(frozen=True)
class Vibration:
    """Small motion about the rest shape, without damping."""

    frequency: float  # highest [1/s]
    growth_rate: float  # largest [1/s]: forces without an energy may feed a vibration, whatever the step


def vibration(mesh: TetMesh, material: Material, law: str) -> Vibration:
    """From all eigenvalues of M^-1 K, with K from differences of the forces."""
    count = mesh.vertices.size
    nudge = 1e-6 * float(mesh.edge_lengths.min())
    stiffness = np.empty((count, count))
    for k in range(count):
        move = np.zeros(count)
        move[k] = nudge
        behind, ahead = (
            internal_forces(mesh, material, mesh.vertices + side * move.reshape(-1, 3), law=law)
            for side in (-1, 1)
        )
        stiffness[:, k] = (behind - ahead).ravel() / (2 * nudge)
    mass = np.repeat(World(floor=None).add_body(mesh, material, law=law).masses, 3)
    squares = np.linalg.eigvals(stiffness / mass[:, None])
    squares = squares[np.abs(squares) > 1e-6 * np.abs(squares).max()]  # without rigid motion
    roots = np.sqrt(squares.astype(complex))
    return Vibration(float(roots.real.max()), float(np.abs(roots.imag).max()))


def stays(mesh: TetMesh, material: Material, law: str, h: float) -> bool:
    """Whether a body that is shaken a little stays near its shape over `STEPS` of leapfrog."""
    noise = 1e-4 * mesh.edge_lengths.min() * np.random.default_rng(0).normal(size=mesh.vertices.shape)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnstableStepWarning)
        warnings.simplefilter("ignore", FrozenBodyWarning)
        world = World(gravity=(0, 0, 0), floor=None)
        body = world.add_body(mesh, material, law=law)
        world.build()
        body.set_motion(mesh.vertices + noise, np.zeros_like(noise))
        for _ in range(STEPS // 20):
            world.step(20 * h, 20)
            gone = np.abs(body.positions() - mesh.vertices).max()
            if body.is_frozen or gone > GROWTH * np.abs(noise).max():
                return False
    return True


def largest_step(mesh: TetMesh, material: Material, law: str, guess: float) -> float:
    """Largest step with which the body stays [s], 0 where it does not at `SHORTEST` either."""
    low, high = SHORTEST * guess, LONGEST * guess
    if not stays(mesh, material, law, low):
        return 0.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if stays(mesh, material, law, middle) else (low, middle)
    return low
