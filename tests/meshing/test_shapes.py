"""Built-in shapes: volumes by formulas, topology by Euler's formula, angles as in the docstrings."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from taichi_soft.core.errors import MeshError, OptionError
from taichi_soft.meshing import beam, box, cylinder, extrude, sphere, torus, voxels

pytestmark = pytest.mark.numpy


def euler(mesh):
    """Vertices - edges + faces - tetrahedra: 1 for a ball, 0 for a ring."""
    faces = (4 * len(mesh.tets) + len(mesh.surface)) // 2
    return len(mesh.vertices) - len(mesh.edges) + faces - len(mesh.tets)


def worst_angle(mesh):
    return mesh.quality.min_dihedral.min()


def centred(mesh):
    return mesh.bounds.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)


@pytest.mark.parametrize("cells", [(1, 1, 1), (2, 1, 3), (4, 4, 4)])
def test_box(cells):
    mesh = box((1, 2, 3), cells)
    assert mesh.volume == pytest.approx(6)
    assert len(mesh.tets) == 5 * np.prod(cells)
    assert len(mesh.vertices) == np.prod(np.array(cells) + 1)
    assert np.ptp(mesh.bounds, axis=0) == pytest.approx([1, 2, 3])
    assert centred(mesh)
    assert euler(mesh) == 1


def test_box_of_cubes_has_no_small_angles():
    assert worst_angle(box()) == pytest.approx(np.degrees(np.arccos(1 / np.sqrt(3))))


def test_beam_cells_are_nearly_cubes():
    assert len(beam(4, 1, 1, 2).tets) == 5 * 8 * 2 * 2
    for size in itertools.product((1.0, 1.26, 1.49, 1.51, 1.74), repeat=2):
        mesh = beam(1.0, *size, cells_across=1)
        assert worst_angle(mesh) > 32
        assert mesh.volume == pytest.approx(size[0] * size[1])


@pytest.mark.parametrize("resolution", [1, 2, 3, 5, 10])
def test_sphere(resolution):
    mesh = sphere(2.0, resolution)
    assert len(mesh.tets) == 20 * resolution**3
    assert euler(mesh) == 1
    assert len(mesh.surface) == 20 * resolution**2
    assert np.linalg.norm(mesh.vertices[mesh.surface_vertices], axis=1) == pytest.approx(2.0)
    assert worst_angle(mesh) > 39.7
    assert centred(mesh)


def test_sphere_volume_converges_with_the_square_of_the_resolution():
    errors = [4 / 3 * np.pi - sphere(1.0, n).volume for n in (3, 6, 12)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.2)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2, abs=0.1)


def inscribed(corners):
    """Return the area of a regular polygon inscribed in the unit circle."""
    return corners / 2 * np.sin(2 * np.pi / corners)


@pytest.mark.parametrize(("rings", "layers"), [(1, 2), (2, 4), (3, 6), (5, 10)])
def test_cylinder(rings, layers):
    mesh = cylinder(0.5, 1.0, rings, layers)
    assert mesh.volume == pytest.approx(0.25 * inscribed(6 * rings))
    assert len(mesh.tets) == 3 * layers * 6 * rings**2
    assert euler(mesh) == 1
    assert worst_angle(mesh) > 35
    assert centred(mesh)
    assert (np.abs(mesh.vertices[:, 2]) == 0.5).sum() == 2 * (3 * rings * (rings + 1) + 1)


def test_torus():
    mesh = torus()
    assert euler(mesh) == 0
    assert len(mesh.surface_vertices) == len(mesh.surface) // 2
    assert worst_angle(mesh) > 31
    assert centred(mesh)
    around = np.hypot(*mesh.vertices[mesh.surface_vertices, :2].T) - 1.0
    assert np.hypot(around, mesh.vertices[mesh.surface_vertices, 2]) == pytest.approx(0.3)


def test_torus_volume_converges_to_pappus():
    exact = 2 * np.pi**2 * 0.3**2
    errors = [exact - torus(1, 0.3, n, 20 * n).volume for n in (1, 2, 4)]
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx([2, 2], abs=0.25)


@settings(max_examples=40)
@given(hnp.arrays(bool, st.tuples(*[st.integers(1, 4)] * 3)).filter(np.any), st.floats(0.1, 10))
def test_voxels_fill_what_the_mask_fills(mask, spacing):
    mesh = voxels(mask, spacing)
    assert len(mesh.tets) == 5 * mask.sum()
    assert mesh.volume == pytest.approx(mask.sum() * spacing**3)
    padded = np.pad(mask, 1).astype(int)
    open_sides = sum(np.abs(np.diff(padded, axis=axis)).sum() for axis in range(3))
    assert len(mesh.surface) == 2 * open_sides
    assert centred(mesh)


def test_voxels_take_three_spacings_and_ignore_empty_margins():
    mask = np.zeros((4, 3, 3), dtype=bool)
    mask[1:3, 1, 1] = True
    mesh = voxels(mask, (1.0, 2.0, 3.0))
    assert mesh.bounds.tolist() == [[-1, -1, -1.5], [1, 1, 1.5]]


def test_extrude_an_l():
    points = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]]
    mesh = extrude(points, [[0, 1, 3], [1, 2, 3], [0, 3, 5], [5, 3, 4]], layers=3, height=2.0)
    assert mesh.volume == pytest.approx(6)
    assert len(mesh.tets) == 4 * 3 * 3
    assert euler(mesh) == 1
    assert centred(mesh)


REFUSED = [
    (box, {"size": (1, 1, 0)}, r"size\[2\] must be .* above 0 m, got 0"),
    (box, {"size": (1, 1)}, "three numbers"),
    (box, {"cells": (4, 0, 4)}, r"cells\[1\] must be a whole number from 1 .*, got 0"),
    (box, {"cells": (4, 4.5, 4)}, r"cells\[1\] must .*, got 4.5"),
    (box, {"cells": 4}, "three numbers"),
    (beam, {"length": -1}, "length must .*, got -1"),
    (beam, {"cells_across": 0}, "cells_across must .*, got 0"),
    (sphere, {"radius": np.nan}, "radius must .*, got nan"),
    (sphere, {"radius": "big"}, "radius must .*, got 'big'"),
    (sphere, {"resolution": 0}, "resolution must .*, got 0"),
    (sphere, {"resolution": True}, "resolution must .*, got True"),
    (cylinder, {"radius": 0}, "radius must .*, got 0"),
    (cylinder, {"height": np.inf}, "height must .*, got inf"),
    (cylinder, {"rings": 0}, "rings must .*, got 0"),
    (cylinder, {"layers": -2}, "layers must .*, got -2"),
    (torus, {"minor_radius": 2}, "minor_radius is 2"),
    (torus, {"segments": 2}, "segments must .* from 3 .*, got 2"),
    (sphere, {"resolution": 10**9}, "resolution must"),
    (sphere, {"resolution": 100}, "20,000,000 tetrahedra"),
    (box, {"cells": (1000, 1000, 1000)}, "5,000,000,000 tetrahedra: .*coarser"),
    (beam, {"cells_across": 1000}, "tetrahedra"),
    (beam, {"length": 1e300, "width": 1e-300}, "cells"),
    (cylinder, {"rings": 10_000}, "tetrahedra"),
    (torus, {"rings": 10_000}, "tetrahedra"),
    (extrude, {"points": [[0, 0], [1, 0], [0, 1]], "triangles": [[0, 1, 2]], "layers": 10**7}, "layers"),
    (voxels, {"mask": np.zeros((2, 2, 2), bool)}, "no filled cell"),
    (voxels, {"mask": np.ones((2, 2), bool)}, r"shape \(2, 2\)"),
    (voxels, {"mask": np.ones((2, 2, 2))}, "dtype float64"),
    (voxels, {"mask": np.ones((2, 2, 2), bool), "spacing": 0}, "spacing"),
    (extrude, {"points": [[0, 0, 0]], "triangles": [[0, 1, 2]]}, r"shape \(1, 3\)"),
    (extrude, {"points": [[0, 0], [1, 0], [0, 1]], "triangles": [[0, 1, 3]]}, "triangle 0"),
    (extrude, {"points": [[0, 0], [1, 0], [2, 0]], "triangles": [[0, 1, 2]]}, "has no volume"),
]


@pytest.mark.parametrize(("make", "options", "message"), REFUSED)
def test_bad_parameters_are_refused_by_name(make, options, message):
    with pytest.raises((MeshError, OptionError), match=message):
        make(**options)
