"""The lattice with subdivided cubes: its good tetrahedra fill space, and points are located in them."""

import numpy as np
import pytest

from taichi_soft.cages.graded import GradedLattice, around, balanced, doubled
from taichi_soft.cages.lattice import Lattice
from taichi_soft.meshing import TetMesh

pytestmark = pytest.mark.numpy

COARSE = Lattice.around_box(np.array([-1.0, 2.0, 0.0]), np.array([-0.3, 2.5, 0.4]), 0.1)


def graded(octaves):
    """Make a lattice with a tenth of the cubes subdivided at random, and some of these once more."""
    random = np.random.default_rng(octaves)
    splits = [random.random(COARSE.cubes) < 0.1]
    for octave in range(1, octaves):
        shape = tuple(2**octave * n for n in COARSE.cubes)
        splits.append((random.random(shape) < 0.02) & doubled(around(splits[-1])))
    return GradedLattice(COARSE, balanced(splits))


@pytest.fixture(scope="module", params=[1, 2, 3])
def lattice(request):
    return graded(request.param)


def mesh_of(lattice, numbers):
    used, rows = np.unique(lattice.corners_of(numbers), return_inverse=True)
    return TetMesh(lattice.points_of(used), rows.reshape(-1, 4))


def test_a_point_lies_in_the_tetrahedron_that_is_named(lattice):
    points = np.random.default_rng(0).uniform([-1.0, 2.0, 0.0], [-0.3, 2.5, 0.4], (20_000, 3))
    corners = lattice.points_of(lattice.corners_of(lattice.tet_at(points)).ravel()).reshape(-1, 4, 3)
    edges = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    shares = np.linalg.solve(edges, (points - corners[:, 0])[..., None])[..., 0]
    assert shares.min() > -1e-9
    assert shares.sum(axis=1).max() < 1 + 1e-9


def test_tetrahedra_meet_face_to_face_without_gaps(lattice):
    """For a solid without cavities, vertices - edges + faces - tetrahedra is 1 (Euler).

    Each inner face has a tetrahedron on both sides. Outer faces lie in the pyramids that the outermost cubes
    lack.
    """
    mesh = mesh_of(lattice, lattice.tets)
    faces = (4 * len(mesh.tets) + len(mesh.surface)) // 2
    assert len(mesh.vertices) - len(mesh.edges) + faces - len(mesh.tets) == 1
    low = np.array(lattice.origin) + 0.1
    high = low + 0.1 * (np.array(COARSE.cubes) - 2)
    middles = mesh.vertices[mesh.surface].mean(axis=1)
    assert not ((middles > low + 1e-9) & (middles < high - 1e-9)).all(axis=1).any()


def test_dihedral_angles_lie_between_45_and_120_degrees(lattice):
    quality = mesh_of(lattice, lattice.tets).quality
    assert quality.min_dihedral.min() == pytest.approx(45.0)
    assert quality.max_dihedral.max() == pytest.approx(120.0)


def test_volumes_are_those_of_the_corners(lattice):
    corners = lattice.points_of(lattice.corners_of(lattice.tets).ravel()).reshape(-1, 4, 3)
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    assert lattice.volumes_of(lattice.tets) == pytest.approx(volumes)
    # Edges are as long as those of cubes after this number of subdivisions, or shorter by sqrt(2).
    longest = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=3).max(axis=(1, 2))
    halved = longest * 2.0 ** lattice.octaves_of(lattice.tets) / 0.1
    assert ((halved > 0.99) & (halved < 2.01)).all()


def test_without_halved_cubes_it_is_the_lattice_of_equal_ones():
    plain = GradedLattice(COARSE, [np.zeros(COARSE.cubes, dtype=bool)])
    points = np.random.default_rng(1).uniform([-1.0, 2.0, 0.0], [-0.3, 2.5, 0.4], (2000, 3))
    one, other = (
        np.sort(each.points_of(each.corners_of(each.tet_at(points)).ravel()).reshape(-1, 4, 3), axis=1)
        for each in (plain, COARSE)
    )
    np.testing.assert_allclose(one, other, atol=1e-12)


def test_touching_cubes_differ_by_one_octave():
    splits = [np.zeros((6, 6, 6), dtype=bool), np.zeros((12, 12, 12), dtype=bool)]
    splits[0][3, 3, 3] = splits[1][6, 6, 6] = True
    first, second = balanced(splits)
    assert second.sum() == 1
    expected = np.zeros((6, 6, 6), dtype=bool)
    expected[2:4, 2:4, 2:4] = True  # cubes at the corner where the small one is
    assert (first == expected).all()
