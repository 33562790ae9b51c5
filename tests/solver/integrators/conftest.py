"""Worlds without floor, one body each; and makes `step_oracle` importable."""

import sys
from pathlib import Path

import numpy as np
import pytest

from taichi_soft.world.bare import bare_world

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def flight():
    """Return a function that builds a world with one body in a given motion, and returns both."""

    def build(mesh, material, x=None, v=None, integrator="leapfrog", gravity=(0, 0, 0), **options):
        world = bare_world(gravity=gravity, floor=None, integrator=integrator, retries=0)
        body = world.add_body(mesh, material, **options)
        world.build()
        x = mesh.vertices if x is None else x
        body.set_motion(x, np.zeros_like(mesh.vertices) if v is None else v)
        return world, body

    return build
