"""Meshes split along faces: all other connections remain."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from taichi_soft import TetMesh, box, sphere, surface_mesh, torus
from taichi_soft.meshing.splitting import connected, inner_faces, loose_parts, split_vertices

pytestmark = pytest.mark.numpy

MESHES = {"box": box((2.0, 0.5, 0.5), (8, 2, 2)), "sphere": sphere(0.5, 3), "torus": torus()}


def cut_by_plane(mesh, normal, offset):
    """Return the faces, True for each face that a plane opens, and the side of each tetrahedron."""
    faces = inner_faces(mesh.tets)
    side = mesh.vertices[mesh.tets].mean(axis=1) @ normal > offset
    return faces, side[faces.tets[:, 0]] != side[faces.tets[:, 1]], side


def components(count, pairs):
    links = coo_array((np.ones(len(pairs)), np.asarray(pairs).reshape(-1, 2).T), shape=(count, count))
    return connected_components(links, directed=False)[1]


def test_connected_agrees_with_scipy():
    rng = np.random.default_rng(0)
    for count, links in ((1, 0), (50, 0), (200, 100), (200, 190), (5000, 4000)):
        pairs = rng.integers(0, count, (links, 2))
        label, oracle = connected(count, pairs[:, 0], pairs[:, 1]), components(count, pairs)
        for group in range(oracle.max() + 1):
            members = np.flatnonzero(oracle == group)
            assert (label[members] == members.min()).all()
    chain = np.arange(100_000)
    assert (connected(100_001, chain, chain + 1) == 0).all()


def test_inner_faces_are_those_that_two_tetrahedra_share():
    mesh = MESHES["sphere"]
    faces = inner_faces(mesh.tets)
    shared = {}
    for t, tet in enumerate(mesh.tets.tolist()):
        for i in range(4):
            shared.setdefault(frozenset(tet[:i] + tet[i + 1 :]), []).append(t)
    expected = {tuple(pair) for pair in shared.values() if len(pair) == 2}
    assert {tuple(pair) for pair in faces.tets.tolist()} == expected
    assert len(faces.tets) == len(expected) == (4 * len(mesh.tets) - len(mesh.surface)) // 2
    sides = [mesh.tets[faces.tets[:, s, None], faces.corners[:, s]] for s in (0, 1)]
    np.testing.assert_array_equal(*sides)


@pytest.mark.parametrize("name", MESHES)
def test_a_plane_takes_a_mesh_apart_into_closed_halves(name):
    mesh = MESHES[name]
    for seed in range(4):
        rng = np.random.default_rng(seed)
        faces, is_cut, side = cut_by_plane(mesh, rng.normal(size=3), 0.03)
        tets, origins = split_vertices(mesh.tets, len(mesh.vertices), faces, is_cut)
        np.testing.assert_array_equal(origins[tets], mesh.tets)
        np.testing.assert_array_equal(origins[: len(mesh.vertices)], np.arange(len(mesh.vertices)))
        assert not set(tets[side].ravel()) & set(tets[~side].ravel())
        cut = TetMesh(mesh.vertices[origins], tets)
        surface = surface_mesh(cut)
        assert surface.is_watertight
        assert surface.is_winding_consistent
        assert surface.volume == pytest.approx(mesh.volume, rel=1e-12)
        # Twice the opened faces come to the surface, all the others stay where they were.
        assert len(cut.surface) == len(mesh.surface) + 2 * is_cut.sum()
        part = loose_parts(tets, len(origins))
        ends = np.concatenate([tets[:, [0, i]] for i in (1, 2, 3)])
        np.testing.assert_array_equal(
            part[:, None] == part, (label := components(len(origins), ends)[tets[:, 0]])[:, None] == label
        )
        assert (np.diff(np.unique(part, return_index=True)[1]) > 0).all()


def test_a_vertex_is_copied_as_often_as_its_tetrahedra_fall_into_groups():
    """The reference is a search from vertex to vertex. Faces are opened at random."""
    mesh = MESHES["box"]
    faces = inner_faces(mesh.tets)
    is_cut = np.random.default_rng(3).random(len(faces.tets)) < 0.4
    tets, origins = split_vertices(mesh.tets, len(mesh.vertices), faces, is_cut)
    for v in range(len(mesh.vertices)):
        around = np.flatnonzero((mesh.tets == v).any(axis=1))
        row = {t: i for i, t in enumerate(around.tolist())}
        whole = [
            pair for pair in faces.tets[~is_cut].tolist() if all(t in row for t in pair)
        ]  # neighbours that both have v share a face with it or opposite of it, where they share it whole
        whole = [pair for pair in whole if v in set(mesh.tets[pair[0]]) & set(mesh.tets[pair[1]])]
        groups = components(len(around), [[row[a], row[b]] for a, b in whole])
        names = tets[around][mesh.tets[around] == v]
        np.testing.assert_array_equal(groups[:, None] == groups, names[:, None] == names)
        assert names[0] == v  # the group of the first tetrahedron keeps it
    assert len(origins) > len(mesh.vertices)


def test_no_cut_changes_nothing_and_one_inner_face_opens_nothing():
    mesh = MESHES["sphere"]
    faces = inner_faces(mesh.tets)
    is_cut = np.zeros(len(faces.tets), dtype=bool)
    inside = ~np.isin(mesh.tets, mesh.surface_vertices).any(axis=1)
    for cut in (
        is_cut,
        is_cut | (np.arange(len(is_cut)) == np.flatnonzero(inside[faces.tets].all(axis=1))[0]),
    ):
        tets, origins = split_vertices(mesh.tets, len(mesh.vertices), faces, cut)
        np.testing.assert_array_equal(tets, mesh.tets)
        assert len(origins) == len(mesh.vertices)
