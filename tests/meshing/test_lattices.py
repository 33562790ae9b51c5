"""Ropes and cloth: connections of particles (thesis fig. 3.4), masses, and refused arguments."""

import copy

import numpy as np
import pytest

from taichi_soft import (
    MeshError,
    OptionError,
    ParticleMesh,
    box,
    cloth,
    cloth_constants,
    edges_as_particles,
    rope,
)

pytestmark = pytest.mark.numpy


def test_a_rope_is_a_chain_whose_ends_weigh_half():
    mesh = rope(2.0, 4, 8.0)
    assert mesh.edges.tolist() == [[0, 1], [1, 2], [2, 3], [3, 4]]
    assert mesh.masses.tolist() == [1, 2, 2, 2, 1]
    np.testing.assert_allclose(mesh.edge_lengths, 0.5)
    assert len(mesh.surface) == 0


@pytest.mark.parametrize(
    ("springs", "count"),
    [
        (("tensile",), 3 * 3 + 4 * 2),
        (("shear",), 2 * 3 * 2),
        (("bend",), 2 * 3 + 4 * 1),
        (("tensile", "shear", "bend"), 17 + 12 + 10),
    ],
)
def test_a_cloth_has_the_springs_of_fig_3_4(springs, count):
    mesh = cloth((3.0, 2.0), (3, 2), 6.0, springs=springs)
    assert len(mesh.vertices) == 4 * 3
    assert len(mesh.edges) == count
    steps = np.abs(mesh.vertices[mesh.edges[:, 1]] - mesh.vertices[mesh.edges[:, 0]])
    kinds = {"tensile": {(1, 0, 0), (0, 1, 0)}, "shear": {(1, 1, 0)}, "bend": {(2, 0, 0), (0, 2, 0)}}
    assert {tuple(step) for step in steps.round(9)} == set().union(*(kinds[kind] for kind in springs))


def test_a_cloth_weighs_by_the_area_round_each_particle():
    mesh = cloth((3.0, 2.0), (3, 2), 6.0)
    assert mesh.masses.sum() == pytest.approx(6.0)
    assert sorted(set(mesh.masses)) == [0.25, 0.5, 1.0]


def test_the_particles_of_a_cloth_stand_in_columns_and_rows_as_far_apart_as_its_sides_say():
    mesh = cloth((3.0, 1.0), (2, 5), 6.0)
    expected = [(1.5 * i - 1.5, 0.2 * j - 0.5, 0.0) for i in range(3) for j in range(6)]
    np.testing.assert_allclose(mesh.vertices, expected, atol=1e-15)


@pytest.mark.parametrize("number", [1, 2, 5])
def test_ropes_and_cloths_are_centred_at_the_origin_as_solids_are(number):
    for mesh in (rope(0.7, number, 1.0), cloth((0.7, 3.1), (number, 3), 1.0)):
        np.testing.assert_allclose(mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0), 0.0, atol=1e-15)
        np.testing.assert_array_equal(mesh.vertices[0], mesh.vertices.min(axis=0))


def test_a_cloth_can_be_seen_from_both_sides():
    mesh = cloth((3.0, 2.0), (3, 2), 6.0)
    a, b, c = (mesh.vertices[mesh.surface[:, i]] for i in range(3))
    area = np.cross(b - a, c - a)[:, 2] / 2
    assert area[area > 0].sum() == pytest.approx(6.0)
    assert area[area < 0].sum() == pytest.approx(-6.0)


def test_each_kind_of_spring_gets_its_own_constant():
    cells = (3, 2)
    mesh = cloth((3.0, 2.0), cells, 6.0)
    constants = cloth_constants(mesh, cells, tensile=1.0, shear=2.0, bend=3.0)
    lengths = mesh.edge_lengths.round(6)
    expected = {1.0: 1.0, round(2**0.5, 6): 2.0, 2.0: 3.0}
    assert constants.tolist() == [expected[length] for length in lengths]
    assert (cloth_constants(mesh, cells, tensile=0, shear=2.0, bend=0) > 0).sum() == 12
    threads = cloth((3.0, 2.0), cells, 6.0, springs=("tensile",))
    assert set(cloth_constants(threads, cells, tensile=4.0)) == {4.0}


def test_the_edges_of_a_solid_keep_its_mass_and_its_skin():
    solid = box((1, 1, 1), (2, 2, 2))
    mesh = edges_as_particles(solid, 500.0)
    assert isinstance(mesh, ParticleMesh)
    assert mesh.masses.sum() == pytest.approx(500.0 * solid.volume)
    assert np.array_equal(mesh.edges, solid.edges)
    assert np.array_equal(mesh.surface, solid.surface)


def test_moved_and_copied_meshes_keep_their_triangles():
    mesh = cloth((1.0, 1.0), (2, 2), 1.0)
    for twin in (copy.deepcopy(mesh), mesh.translated((0, 0, 1)), mesh.scaled(2.0)):
        assert np.array_equal(twin.surface, mesh.surface)
        assert not twin.surface.flags.writeable


REFUSED = {
    "length": (lambda: rope(0.0, 3, 1.0), OptionError, "length"),
    "segments": (lambda: rope(1.0, 0, 1.0), OptionError, "segments"),
    "mass": (lambda: rope(1.0, 3, -1.0), OptionError, "mass"),
    "size": (lambda: cloth((1.0, 0.0), (2, 2), 1.0), OptionError, "size"),
    "cells": (lambda: cloth((1.0, 1.0), (2, 0), 1.0), OptionError, "cells"),
    "one number of cells": (lambda: cloth((1.0, 1.0), 3, 1.0), OptionError, "cells must be two"),
    "kind": (lambda: cloth((1.0, 1.0), (2, 2), 1.0, springs=("knit",)), OptionError, "springs must be some"),
    "no kind": (lambda: cloth((1.0, 1.0), (2, 2), 1.0, springs=()), OptionError, "springs must be some"),
    "unknown": (
        lambda: cloth_constants(cloth((1, 1), (2, 2), 1.0), (2, 2), knit=1.0),
        OptionError,
        "unknown spring kind 'knit'",
    ),
    "other cells": (
        lambda: cloth_constants(cloth((1, 1), (2, 2), 1.0), (3, 2), bend=1.0),
        MeshError,
        "has 12 vertices, not 9",
    ),
    "cells the other way round": (
        lambda: cloth_constants(cloth((1, 1), (3, 2), 1.0), (2, 3), tensile=1.0, shear=1.0, bend=1.0),
        MeshError,
        r"edge 0 .*\(2, 3\) cells: pass",
    ),
    "missing": (
        lambda: cloth_constants(cloth((1, 1), (2, 2), 1.0), (2, 2), tensile=1.0, shear=1.0),
        OptionError,
        "the cloth has bend springs: .*bend=.*0",
    ),
    "constant": (
        lambda: cloth_constants(cloth((1, 1), (2, 2), 1.0), (2, 2), tensile="1", shear=1, bend=1),
        OptionError,
        "tensile must be a number",
    ),
    "cells of constants": (lambda: cloth_constants(cloth((1, 1), (2, 2), 1.0), 3), OptionError, "two whole"),
    "no list of kinds": (lambda: cloth((1.0, 1.0), (2, 2), 1.0, springs=None), OptionError, "some of"),
    "density": (lambda: edges_as_particles(box((1, 1, 1), (1, 1, 1)), 0.0), OptionError, "above 0"),
    "densities": (lambda: edges_as_particles(box((1, 1, 1), (1, 1, 1)), [1, 2]), OptionError, "shape"),
    "words": (lambda: edges_as_particles(box((1, 1, 1), (1, 1, 1)), "x"), OptionError, "density"),
    "no solid": (lambda: edges_as_particles(rope(1.0, 2, 1.0), 1.0), MeshError, "must be a TetMesh"),
    "alone": (
        lambda: ParticleMesh(np.eye(3), [[0, 1]], 1.0),
        MeshError,
        "vertex 2 belongs to no edge: remove it",
    ),
    "triangle out of range": (
        lambda: ParticleMesh(np.eye(3), [[0, 1], [1, 2]], 1.0, surface=[[0, 1, 3]]),
        MeshError,
        "surface|triangle",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_bad_input_is_refused(name):
    make, error, text = REFUSED[name]
    with pytest.raises(error, match=text):
        make()
