"""TetMesh: computed properties, compared with slower or analytic methods, and refused input."""

import copy
import itertools
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taichi_soft.core.errors import MeshError, OptionError
from taichi_soft.meshing import BodyMesh, TetMesh, beam, box, cylinder, extrude, sphere, torus, voxels

pytestmark = pytest.mark.numpy

CORNER = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
TWO = np.vstack([CORNER, [[1.0, 1, 1]]])
TWO_TETS = [[0, 1, 2, 3], [4, 2, 1, 3]]

SHAPES = {
    "one": lambda: TetMesh(CORNER, [[0, 1, 2, 3]]),
    "two": lambda: TetMesh(TWO, TWO_TETS, fix_orientation=True),
    "box": lambda: box((1, 2, 3), (2, 3, 4)),
    "beam": lambda: beam(3, 1, 0.5, 1),
    "sphere": lambda: sphere(1.0, 3),
    "cylinder": lambda: cylinder(1.0, 2.0, 3, 5),
    "torus": lambda: torus(1.0, 0.3, 2, 12),
    "voxels": lambda: voxels(np.array([[[1, 1, 0], [0, 1, 1]]], dtype=bool), 0.5),
    "extrude": lambda: extrude([[0, 0], [1, 0], [1, 1], [0, 1]], [[0, 1, 2], [0, 2, 3]], 3, 1.0),
}


@pytest.fixture(params=SHAPES, scope="module")
def mesh(request):
    return SHAPES[request.param]()


def test_edges_are_the_pairs_that_share_a_tetrahedron(mesh):
    pairs = {tuple(sorted(p)) for tet in mesh.tets.tolist() for p in itertools.combinations(tet, 2)}
    assert mesh.edges.tolist() == [list(pair) for pair in sorted(pairs)]


def test_tet_edges_follow_the_documented_local_order(mesh):
    local = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
    for tet, rows in zip(mesh.tets, mesh.tet_edges, strict=True):
        expected = [sorted((tet[i], tet[j])) for i, j in local]
        assert mesh.edges[rows].tolist() == expected


def test_edge_valence_counts_tetrahedra(mesh):
    sets = [set(tet) for tet in mesh.tets.tolist()]
    expected = [sum({i, j} <= tet for tet in sets) for i, j in mesh.edges.tolist()]
    assert mesh.edge_valence.tolist() == expected


def test_surface_encloses_the_sum_of_the_tetrahedra(mesh):
    """Divergence theorem: a third of the flux of x through the surface is the volume inside."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.surface], 1, 0)
    flux = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
    by_determinant = sum(np.linalg.det(mesh.vertices[t[1:]] - mesh.vertices[t[0]]) / 6 for t in mesh.tets)
    assert flux == pytest.approx(mesh.volume, rel=1e-12)
    assert by_determinant == pytest.approx(mesh.volume, rel=1e-12)
    assert mesh.vertex_volumes.sum() == pytest.approx(mesh.volume, rel=1e-12)


def test_surface_is_closed_and_consistently_wound(mesh):
    """Every directed edge of the surface runs as often one way as the other."""
    directed = mesh.surface[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    there = sorted(map(tuple, directed.tolist()))
    assert there == sorted(map(tuple, directed[:, ::-1].tolist()))
    assert mesh.surface_vertices.tolist() == sorted(set(mesh.surface.ravel().tolist()))


def test_surface_normals_point_away_from_the_tetrahedron_inside(mesh):
    owner = {tuple(sorted(f)): t for t in mesh.tets.tolist() for f in itertools.combinations(t, 3)}
    for face in mesh.surface.tolist():
        (inner,) = set(owner[tuple(sorted(face))]) - set(face)
        a, b, c = mesh.vertices[face]
        assert np.dot(np.cross(b - a, c - a), mesh.vertices[inner] - a) < 0


def test_arrays_have_the_stated_types_and_are_locked(mesh):
    kinds = {
        "vertices": "f8",
        "tets": "i4",
        "edges": "i4",
        "surface": "i4",
        "tet_edges": "i4",
        "volumes": "f8",
    }
    kinds |= {"vertex_volumes": "f8", "edge_valence": "i4", "surface_vertices": "i4", "edge_lengths": "f8"}
    for name, kind in kinds.items():
        array = getattr(mesh, name)
        assert array.dtype == np.dtype(kind), name
        assert array.flags.c_contiguous, name
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_one_tetrahedron_by_hand():
    mesh = TetMesh(CORNER, [[0, 1, 2, 3]])
    assert mesh.volume == pytest.approx(1 / 6)
    assert mesh.vertex_volumes == pytest.approx(np.full(4, 1 / 24))
    assert len(mesh.surface) == 4
    assert mesh.edge_lengths == pytest.approx([1, 1, 1, 2**0.5, 2**0.5, 2**0.5])
    assert isinstance(mesh, BodyMesh)
    assert repr(mesh) == "TetMesh(4 vertices, 1 tetrahedra, 0.166667 m^3)"


def test_callers_arrays_are_copied_and_left_alone():
    vertices, tets = CORNER.copy(), np.array([[0, 1, 3, 2]], dtype=np.int32)
    mesh = TetMesh(vertices, tets, fix_orientation=True)
    vertices[:], tets[:] = 7.0, 0
    assert mesh.vertices.tolist() == CORNER.tolist()
    assert mesh.tets.tolist() == [[0, 1, 2, 3]]


def test_attributes_cannot_be_set_or_deleted():
    mesh = TetMesh(CORNER, [[0, 1, 2, 3]])
    with pytest.raises(AttributeError, match="immutable"):
        mesh.vertices = CORNER
    with pytest.raises(AttributeError, match="immutable"):
        del mesh.tets


def test_copies_are_locked_too():
    mesh = box()
    for twin in (copy.deepcopy(mesh), pickle.loads(pickle.dumps(mesh))):
        assert twin.tets.tolist() == mesh.tets.tolist()
        assert not twin.vertices.flags.writeable


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.floats(0.01, 100))
def test_moves_change_volume_as_they_should(seed, factor):
    """Rotation and translation preserve volumes, and scaling multiplies them by its cube.

    Connections do not change.
    """
    random = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(random.normal(size=(3, 3)))
    rotation *= np.sign(np.linalg.det(rotation))
    mesh = sphere(1.0, 1)
    moved = mesh.rotated(rotation).translated(random.normal(size=3)).scaled(factor)
    assert moved.volumes == pytest.approx(mesh.volumes * factor**3, rel=1e-9)
    assert moved.tets.tolist() == mesh.tets.tolist()


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_fix_orientation_undoes_any_shuffle_of_corners(seed):
    random = np.random.default_rng(seed)
    mesh = sphere(1.0, 2)
    shuffled = random.permuted(mesh.tets, axis=1)
    fixed = TetMesh(mesh.vertices, shuffled, fix_orientation=True)
    assert np.sort(fixed.tets).tolist() == np.sort(mesh.tets).tolist()
    assert fixed.volumes == pytest.approx(mesh.volumes)
    assert fixed.edges.tolist() == mesh.edges.tolist()


@pytest.mark.parametrize("bad", [0, -1, np.nan, np.inf, (1, 2, 3), [[1], [1, 2]]])
def test_scaled_refuses(bad):
    with pytest.raises(OptionError, match="factor"):
        box().scaled(bad)


@pytest.mark.parametrize(
    "bad", [np.diag([1, 1, -1]), 2 * np.eye(3), np.eye(2), np.full((3, 3), np.nan), [[1], [1, 2]], "up"]
)
def test_rotated_refuses(bad):
    with pytest.raises(OptionError, match="rotation"):
        box().rotated(bad)


@pytest.mark.parametrize("bad", [[1, 2], [1, 2, np.nan], "abc"])
def test_translated_refuses(bad):
    with pytest.raises(OptionError, match="offset"):
        box().translated(bad)


FAN = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1], [0.5, 0.5, 2]])
FOLDED = np.vstack([CORNER, [[0.2, 0.2, 0.9]]])

REFUSED = {
    "no vertices": (np.zeros((0, 3)), [[0, 1, 2, 3]], "vertices is empty"),
    "no tetrahedra": (CORNER, [], "tets is empty"),
    "no tetrahedra, shaped": (CORNER, np.zeros((0, 4), int), "tets is empty"),
    "flat points": (CORNER[:, :2], [[0, 1, 2, 3]], r"shape \(4, 2\)"),
    "one list of numbers": (np.zeros(12), [[0, 1, 2, 3]], r"shape \(12,\)"),
    "triangles": (CORNER, [[0, 1, 2]], r"shape \(1, 3\)"),
    "ragged": (CORNER, [[0, 1, 2, 3], [0, 1]], "rectangular"),
    "words": ([["a", "b", "c"]], [[0, 1, 2, 3]], "dtype"),
    "complex": (CORNER + 1j, [[0, 1, 2, 3]], "dtype complex128"),
    "float indices": (CORNER, [[0.0, 1, 2, 3]], "dtype float64: pass integer"),
    "bool indices": (CORNER, np.ones((1, 4), bool), "dtype bool"),
    "nan": (np.where(np.eye(4, 3), np.nan, CORNER), [[0, 1, 2, 3]], "vertex 0 is .*finite"),
    "infinite": (np.vstack([CORNER[:3], [[0, np.inf, 1]]]), [[0, 1, 2, 3]], "vertex 3 is .*finite"),
    "absurdly far": (CORNER * 1e200, [[0, 1, 2, 3]], r"vertex 1 is .*1e\+30"),
    "index too high": (CORNER, [[0, 1, 2, 4]], "tetrahedron 0 names vertices 0, 1, 2, 4, but there are 4"),
    "index past 32 bits": (CORNER, [[0, 1, 2, 2**32 + 3]], "4294967299"),
    "negative index": (CORNER, [[0, 1, 2, 3], [0, 1, 2, -1]], "tetrahedron 1 names vertices 0, 1, 2, -1"),
    "vertex twice": (CORNER, [[0, 1, 2, 1]], "tetrahedron 0 names a vertex twice"),
    "same tetrahedron": (CORNER, [[0, 1, 2, 3], [3, 1, 0, 2]], "tetrahedra 0 and 1 have the same"),
    "flat": (np.vstack([CORNER[:3], [[1, 1, 0]]]), [[0, 1, 2, 3]], "tetrahedron 0 has no volume"),
    "nearly flat": (CORNER * [1, 1, 1e-8], [[0, 1, 2, 3]], "tetrahedron 0 has no volume"),
    "one of two flat": (
        np.vstack([CORNER, [[1, 1, 0]]]),
        [[0, 1, 2, 3], [0, 1, 2, 4]],
        "tetrahedron 1 has no volume",
    ),
    "all in one point": (np.ones((4, 3)), [[0, 1, 2, 3]], "tetrahedron 0 has no volume"),
    "inverted": (TWO, [[0, 1, 2, 3], [4, 1, 2, 3]], r"tetrahedron 1 has volume -.*fix_orientation=True"),
    "unused vertex": (TWO, [[0, 1, 2, 3]], "vertex 4 belongs to no tetrahedron"),
    "three at a face": (FAN, [[0, 1, 2, 3], [0, 2, 1, 4], [0, 1, 2, 5]], "vertices .* is shared by 3 tetra"),
    "overlapping, far down": (
        np.vstack([np.add(CORNER, 9), FOLDED]),
        [[0, 1, 2, 3], [4, 5, 6, 7], [4, 5, 6, 8]],
        "tetrahedra 1 and 2 lie on the same side",
    ),
    "overlapping": (FOLDED, [[0, 1, 2, 3], [0, 1, 2, 4]], "tetrahedra 0 and 1 lie on the same side"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bad_meshes_are_refused_by_name(case):
    vertices, tets, message = REFUSED[case]
    with pytest.raises(MeshError, match=message) as caught:
        TetMesh(vertices, tets)
    assert "\n" not in str(caught.value)


def test_fix_orientation_does_not_hide_a_fold():
    """A tetrahedron pushed inside out through its neighbour still overlaps it after being turned round."""
    with pytest.raises(MeshError, match="same side"):
        TetMesh(FOLDED, [[0, 1, 2, 3], [0, 2, 1, 4]], fix_orientation=True)


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1e3, 1e9])
def test_the_test_for_flatness_does_not_depend_on_size(scale):
    assert TetMesh(CORNER * scale, [[0, 1, 2, 3]]).volume == pytest.approx(scale**3 / 6)
