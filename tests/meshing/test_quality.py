"""MeshQuality compared with tetrahedra of known measures."""

import math

import numpy as np
import pytest

from taichi_soft.meshing import TetMesh

pytestmark = pytest.mark.numpy

REGULAR = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])


def one(vertices):
    return TetMesh(vertices, [[0, 1, 2, 3]], fix_orientation=True).quality


def test_regular_tetrahedron():
    quality = one(REGULAR)
    assert quality.min_dihedral[0] == pytest.approx(math.degrees(math.acos(1 / 3)), abs=1e-10)
    assert quality.max_dihedral[0] == pytest.approx(70.5288, abs=1e-4)
    assert quality.aspect_ratio[0] == pytest.approx(1.0, abs=1e-12)
    assert quality.shortest_edge == pytest.approx(math.sqrt(8))
    assert quality.longest_edge == pytest.approx(math.sqrt(8))


def test_corner_of_a_cube():
    """Inradius (3 - sqrt 3)/6 and circumradius sqrt 3 / 2; angles 90 and acos(1/sqrt 3)."""
    quality = one(np.vstack([np.zeros(3), np.eye(3)]))
    assert quality.min_dihedral[0] == pytest.approx(math.degrees(math.acos(1 / math.sqrt(3))))
    assert quality.max_dihedral[0] == pytest.approx(90)
    assert quality.aspect_ratio[0] == pytest.approx(3 * (3 - math.sqrt(3)) / 6 / (math.sqrt(3) / 2))
    assert (quality.shortest_edge, quality.longest_edge) == pytest.approx((1, math.sqrt(2)))


def test_measures_do_not_depend_on_size_place_or_numbering():
    base = TetMesh(np.random.default_rng(1).normal(size=(4, 3)), [[0, 1, 2, 3]], fix_orientation=True)
    other = TetMesh(base.scaled(37).translated([1, 2, 3]).vertices, base.tets[:, [1, 2, 0, 3]])
    for name in ("min_dihedral", "max_dihedral", "aspect_ratio"):
        assert getattr(other.quality, name) == pytest.approx(getattr(base.quality, name), rel=1e-9)


@pytest.mark.parametrize("height", [0.3, 0.03, 0.003])
def test_flat_tetrahedra_score_towards_zero(height):
    """Two crossed unit segments a small height apart: two angles near 180 degrees, four near 0."""
    quality = one([[-0.5, 0, 0], [0.5, 0, 0], [0, -0.5, height], [0, 0.5, height]])
    assert quality.aspect_ratio[0] < 4 * height
    # The plane through an edge and either other vertex rises by `height` over half a unit.
    assert quality.max_dihedral[0] == pytest.approx(2 * math.degrees(math.atan2(0.5, height)), rel=1e-9)


def test_summary_is_one_line_with_the_worst_values():
    summary = one(REGULAR).summary()
    assert "70.5 to 70.5 deg" in summary
    assert "\n" not in summary
