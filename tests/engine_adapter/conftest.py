"""A small world for the tests of the adapter."""

import pytest

from taichi_soft import Material, box
from taichi_soft.world.bare import bare_world


@pytest.fixture
def make_world():
    """Builds a world with one soft cube that falls from 1 m."""

    def build(**options):
        world = bare_world(**options)
        world.add_body(box(cells=(2, 2, 2)), Material(1e5, 0.2, 1000.0, 20.0), position=(0, 0, 1.0))
        world.build()
        return world

    return build
