"""Worlds with one small body."""

import sys
from pathlib import Path

import numpy as np
import pytest

from taichi_soft import Material, World, box, load_mesh

sys.path.insert(0, str(Path(__file__).parent))  # for `random_play`

ASSETS = Path(__file__).parents[2] / "assets"


@pytest.fixture(scope="session")
def thesis_mesh():
    """The thesis's sphere, diameter about 2 m."""
    return load_mesh(ASSETS / "sphere.npz")


@pytest.fixture(scope="session")
def cube():
    """A cube of 1 m about the origin: 27 vertices, 40 tetrahedra."""
    return box(cells=(2, 2, 2))


@pytest.fixture(scope="session")
def jelly():
    return Material(young=1e5, poisson=0.2, density=1000.0, damping=20.0, damping_ratio=0.0)


@pytest.fixture(scope="session")
def turned():
    """A rotation matrix about a skew axis, from the exponential of its generator."""
    axis = np.array([0.3, -0.5, 0.8])
    axis = axis / np.linalg.norm(axis) * 0.9
    generator = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    matrix, term = np.eye(3), np.eye(3)
    for power in range(1, 25):
        term = term @ generator / power
        matrix = matrix + term
    return matrix


@pytest.fixture
def solo():
    """Builds a world with one body, without a floor where the body lies at the origin. Returns both."""

    def build(mesh, material, world_options=None, **body_options):
        usual = {} if "position" in body_options else {"floor": None}
        world = World(**{**usual, **(world_options or {})})
        body = world.add_body(mesh, material, **{"law": "virial", **body_options})
        world.build()
        return world, body

    return build


@pytest.fixture
def empty(play):
    """The built world with pools of a test file's `play`, and their assets, without bodies."""
    world, kinds = play
    for body in world.bodies:
        world.despawn(body)
    return world, kinds
