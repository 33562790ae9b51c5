"""Particles of 1 kg, each on a spring to a pinned particle: u'' = -k u - b u'.

With these particles, the integrators of a world solve the test equations of chapter 3. All particles move
along their springs, which are linear in this direction.
"""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft import ParticleMesh, SpringMaterial, UnstableStepWarning
from taichi_soft.core.types import IntegratorName
from taichi_soft.world.bare import bare_world

Floats = NDArray[np.float64]

LENGTH = 1.0
"""Length of the springs [m]; displacements must be much smaller."""

SLACK = 1e-9
"""Stiffness of a spring that should only damp [N/m]. The stiffness of a spring must not be zero."""


def run_oscillators(
    integrator: IntegratorName,
    stiffness: ArrayLike,
    damping: ArrayLike,
    start: tuple[ArrayLike, ArrayLike],
    steps: int,
) -> tuple[Floats, Floats]:
    """Return displacements [m] and velocities [m/s] at the start and after each step, (steps + 1, m) each.

    Steps are 1 s long. Therefore k is (h w)^2, and b is h times the damping per mass.
    Args:
        stiffness: k [N/m], (m,).
        damping: b [N s/m], (m,).
        start: initial displacements and velocities, (m,) each.
        steps: number of steps.
    """
    k, b, u, v = (np.atleast_1d(np.asarray(rows, float)) for rows in (stiffness, damping, *start))
    count = len(k)
    rest = np.zeros((2 * count, 3))
    rest[0::2, 0] = -LENGTH  # free ends at 0, where float32 is most precise
    rest[:, 1] = np.repeat(np.arange(count), 2)
    mesh = ParticleMesh(rest, np.arange(2 * count).reshape(-1, 2), np.ones(2 * count))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnstableStepWarning)
        world = bare_world(gravity=(0, 0, 0), floor=None, integrator=integrator, tolerance=1e-6, retries=0)
        body = world.add_body(mesh, SpringMaterial(k, b), law="springs", pinned=np.arange(0, 2 * count, 2))
        world.build()
        positions, velocities = rest.copy(), np.zeros_like(rest)
        positions[1::2, 0], velocities[1::2, 0] = u, v
        body.set_motion(positions, velocities)
        found = [(u, v)]
        for _ in range(steps):
            world.step(1.0, 1)
            found.append((body.positions()[1::2, 0].astype(float), body.velocities()[1::2, 0].astype(float)))
    return np.array([row[0] for row in found]), np.array([row[1] for row in found])


def step_factors(integrator: IntegratorName, stiffness: ArrayLike, damping: ArrayLike) -> Floats:
    """Return the largest modulus of the eigenvalues of a step for each oscillator, (m,).

    Above 1, the motion grows. The eigenvalues are computed from the states after two and three steps, in two
    runs with different initial states. The state of the integrator must consist of position and velocity at
    the same time.
    """
    k, b = np.asarray(stiffness, float), np.asarray(damping, float)
    amount = np.full(len(k), 1e-2 * LENGTH)
    none = np.zeros(len(k))
    runs = [run_oscillators(integrator, k, b, start, 3) for start in ((amount, none), (none, amount))]
    states = np.array([[run[0], run[1]] for run in runs]).transpose(2, 3, 1, 0)  # (steps, m, state, start)
    return np.asarray(np.abs(np.linalg.eigvals(states[3] @ np.linalg.inv(states[2]))).max(axis=1))
