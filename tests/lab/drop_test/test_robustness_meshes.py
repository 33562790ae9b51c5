"""Meshes of the sweep: their number, their quality, and the figures that they fill."""

import numpy as np
import pytest

from lab.drop_test.robustness import foreign_meshes
from lab.drop_test.robustness.foreign_meshes import FOREIGN_MESHES, flat_body, sliver_lattice
from lab.drop_test.robustness.own_meshes import OWN_MESHES

pytestmark = pytest.mark.soak


@pytest.fixture(scope="module")
def foreign():
    return {name: make() for name, make in FOREIGN_MESHES.items()}


def area(loops):
    """Return the area of a figure with holes, by the shoelace formula."""
    areas = []
    for loop in loops:
        x, y = np.array(loop, dtype=float).T
        areas.append(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)
    return areas[0] - sum(areas[1:])


def test_there_are_as_many_as_are_wanted():
    assert len(OWN_MESHES) == 36
    assert len(FOREIGN_MESHES) >= 45


def test_foreign_meshes_have_slivers_thin_parts_and_many_scales(foreign):
    angles = np.array([mesh.quality.min_dihedral.min() for mesh in foreign.values()])
    sizes = np.array([np.ptp(mesh.vertices, axis=0).max() for mesh in foreign.values()])
    thinness = np.array(
        [(lambda box: box.min() / box.max())(np.ptp(m.vertices, axis=0)) for m in foreign.values()]
    )
    assert angles.min() < 0.1
    assert (angles < 2.0).sum() >= 20
    assert sizes.min() < 0.011
    assert sizes.max() > 9.9
    assert (thinness < 0.03).sum() >= 5
    for name, mesh in foreign.items():
        assert (mesh.volumes > 0).all(), name
        assert 50 <= len(mesh.tets) <= 5000, name
        corners = mesh.vertices[mesh.tets]
        signed = np.linalg.det(corners[:, 1:] - corners[:, :1])
        assert (signed > 0).all(), name


def test_a_mesh_is_the_same_every_time(foreign):
    for name in ("graded 1 to 10, 1 m", "letter E, 0.1 m", "lattice with slivers 0.01, 1 m"):
        again = FOREIGN_MESHES[name]()
        np.testing.assert_array_equal(again.vertices, foreign[name].vertices)
        np.testing.assert_array_equal(again.tets, foreign[name].tets)


@pytest.mark.parametrize("letter", ["A", "B", "E", "O", "X"])
def test_letters_fill_their_figures_holes_left_out(letter):
    loops = foreign_meshes._LETTERS[letter]
    high = np.ptp(np.array(loops[0], dtype=float), axis=0).max()
    mesh = flat_body(loops, 2.0, 0.3, 1, 0.05, 7)
    assert mesh.volume == pytest.approx(0.3 * area(loops) * (2.0 / high) ** 2, rel=0.01)


def test_a_lattice_that_is_less_disturbed_has_flatter_slivers():
    coarse, fine = (np.sort(sliver_lattice(1.0, 4, jitter, 3).quality.min_dihedral) for jitter in (0.1, 0.01))
    tenth = len(fine) // 10
    assert fine[tenth] < 0.3 * coarse[tenth]


def test_grading_makes_edges_longer_by_its_ratio():
    mesh = foreign_meshes.graded_box(1.0, 100, 20.0, 1)
    middles = mesh.vertices[mesh.edges].mean(axis=1) + 0.5  # of the cube from 0 to 1
    away = np.linalg.norm(middles, axis=1)
    near, far = (np.median(mesh.edge_lengths[rows]) for rows in (away < 0.1, away > 1.2))
    assert 8.0 < far / near < 40.0
