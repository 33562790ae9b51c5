"""Shading on the page: round surfaces look round, and edges of boxes stay sharp."""

import numpy as np
import pytest

pytest.importorskip("websockets", reason="needs websockets: pip install 'taichi-soft[live]'")

from taichi_soft import box, cylinder, sphere, torus
from taichi_soft.live.drawn import CREASE
from taichi_soft.meshing.creases import split_at_creases


def copies_of(mesh):
    """Return the number of normals of each vertex of the surface."""
    vertices, _ = split_at_creases(np.asarray(mesh.vertices, dtype=float), mesh.surface, CREASE)
    return np.bincount(vertices)[np.unique(mesh.surface)]


@pytest.mark.parametrize("mesh", [*(sphere(0.3, n) for n in (1, 2, 3)), torus(0.32, 0.13, 1, 18)])
def test_coarse_balls_and_rings_have_one_normal_at_each_vertex(mesh):
    assert (copies_of(mesh) == 1).all()


def test_edges_of_boxes_and_rims_of_cylinders_are_sharp():
    block = box((0.5, 0.5, 0.5), (1, 1, 1))
    assert (copies_of(block) == 3).all()
    drum = cylinder(0.28, 0.5, rings=2, layers=4)
    points = np.asarray(drum.vertices)[np.unique(drum.surface)]
    on_rim = (np.abs(np.hypot(points[:, 0], points[:, 1]) - 0.28) < 1e-6) & (
        np.isclose(points[:, 2], points[:, 2].min()) | np.isclose(points[:, 2], points[:, 2].max())
    )
    assert (copies_of(drum) == np.where(on_rim, 2, 1)).all()
