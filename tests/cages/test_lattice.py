"""The body-centred lattice: its tetrahedra are alike and fill space, and points are located in them."""

import numpy as np
import pytest

from taichi_soft.cages.lattice import Lattice
from taichi_soft.meshing import TetMesh

pytestmark = pytest.mark.numpy

LATTICE = Lattice.around_box(np.array([-1.0, 2.0, 0.0]), np.array([0.0, 2.7, 0.4]), 0.1)


def tets_of(numbers):
    used, rows = np.unique(LATTICE.corners_of(numbers), return_inverse=True)
    return TetMesh(LATTICE.points_of(used), rows.reshape(-1, 4))


def test_a_point_lies_in_the_tetrahedron_that_is_named():
    points = np.random.default_rng(0).uniform([-1.0, 2.0, 0.0], [0.0, 2.7, 0.4], (5000, 3))
    corners = LATTICE.points_of(LATTICE.corners_of(LATTICE.tet_at(points)).ravel()).reshape(-1, 4, 3)
    edges = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    shares = np.linalg.solve(edges, (points - corners[:, 0])[..., None])[..., 0]
    assert shares.min() > -1e-9
    assert shares.sum(axis=1).max() < 1 + 1e-9


def test_all_tetrahedra_are_alike_and_fill_space_without_gaps():
    inner = np.random.default_rng(1).uniform([-0.9, 2.1, 0.1], [-0.1, 2.6, 0.3], (40_000, 3))
    mesh = tets_of(np.unique(LATTICE.tet_at(inner)))
    assert mesh.volumes == pytest.approx(np.full(len(mesh.tets), 0.1**3 / 12))
    assert mesh.quality.min_dihedral == pytest.approx(np.full(len(mesh.tets), 60.0))
    assert mesh.quality.max_dihedral == pytest.approx(np.full(len(mesh.tets), 90.0))
    assert LATTICE.volumes_of(np.arange(2)) == pytest.approx([0.1**3 / 12] * 2)
    # Of a solid without cavities, vertices - edges + faces - tetrahedra is 1 (Euler).
    faces = (4 * len(mesh.tets) + len(mesh.surface)) // 2
    assert len(mesh.vertices) - len(mesh.edges) + faces - len(mesh.tets) == 1
