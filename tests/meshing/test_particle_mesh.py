"""ParticleMesh: edges and masses stay as given, and invalid input is refused."""

import copy

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taichi_soft.core.errors import MeshError
from taichi_soft.meshing import BodyMesh, ParticleMesh

pytestmark = pytest.mark.numpy

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
ROUND = [[0, 1], [1, 2], [2, 3], [3, 0]]


def test_a_square_of_four_particles():
    mesh = ParticleMesh(SQUARE, ROUND, [1, 2, 3, 4])
    assert mesh.edges.tolist() == [[0, 1], [1, 2], [2, 3], [0, 3]]
    assert mesh.masses.tolist() == [1, 2, 3, 4]
    assert mesh.edge_lengths.tolist() == [1, 1, 1, 1]
    assert mesh.tets.shape == (0, 4)
    assert isinstance(mesh, BodyMesh)
    assert repr(mesh) == "ParticleMesh(4 vertices, 4 edges)"


def test_types_and_locks():
    mesh = ParticleMesh(SQUARE.tolist(), ROUND, 0.5)
    for twin in (mesh, copy.deepcopy(mesh), mesh.scaled(2.0)):
        assert [a.dtype.str[1:] for a in (twin.vertices, twin.edges, twin.masses)] == ["f8", "i4", "f8"]
        assert not any(a.flags.writeable for a in (twin.vertices, twin.edges, twin.masses))
        assert twin.masses.tolist() == [0.5] * 4
    with pytest.raises(AttributeError, match="immutable"):
        mesh.masses = np.ones(4)


def test_callers_arrays_are_copied():
    masses = np.ones(4)
    mesh = ParticleMesh(SQUARE, ROUND, masses)
    masses[:] = 9
    assert mesh.masses.tolist() == [1, 1, 1, 1]


@given(st.permutations(range(4)), st.lists(st.booleans(), min_size=4, max_size=4))
def test_edges_keep_their_order_and_lead_upwards(order, turned):
    """Therefore, values per edge in a SpringMaterial belong to the given edges."""
    edges = np.array(ROUND)[list(order)]
    edges[turned] = edges[turned][:, ::-1]
    assert ParticleMesh(SQUARE, edges, 1.0).edges.tolist() == np.sort(edges, axis=1).tolist()


REFUSED = {
    "no vertices": ([], ROUND, 1.0, "vertices is empty"),
    "no edges": (SQUARE, [], 1.0, "edges is empty"),
    "nan": (SQUARE * np.nan, ROUND, 1.0, "vertex 0"),
    "float edges": (SQUARE, [[0.0, 1]], 1.0, "dtype float64"),
    "shape": (SQUARE, [[0, 1, 2]], 1.0, r"shape \(1, 3\)"),
    "out of range": (SQUARE, [[0, 1], [1, 4]], 1.0, "edge 1 names vertices 1, 4"),
    "negative": (SQUARE, [[0, -1]], 1.0, "edge 0 names vertices 0, -1"),
    "to itself": (SQUARE, [[0, 1], [2, 2]], 1.0, "edge 1 names a vertex twice"),
    "given twice": (SQUARE, [[0, 1], [1, 2], [1, 0]], 1.0, "edges 0 and 2 join the same vertices"),
    "zero length": (np.zeros((4, 3)), ROUND, 1.0, "edge 0 has zero length"),
    "two on one spot": ([[1, 2, 3], [2, 2, 3], [2, 2, 3], [0, 2, 3]], ROUND, 1.0, "edge 1 has zero length"),
    "massless": (SQUARE, ROUND, [1, 1, 0, 1], "mass 2 is 0 kg"),
    "negative mass": (SQUARE, ROUND, -1.0, "mass 0 is -1 kg"),
    "mass nan": (SQUARE, ROUND, [1, np.nan, 1, 1], "mass 1"),
    "too few masses": (SQUARE, ROUND, [1, 1, 1], r"masses has shape \(3,\)"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bad_meshes_are_refused_by_name(case):
    vertices, edges, masses, message = REFUSED[case]
    with pytest.raises(MeshError, match=message):
        ParticleMesh(vertices, edges, masses)
