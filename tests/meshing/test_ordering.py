"""Memory orders: permutations, the Morton curve, and smaller distances of neighbours in memory."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from taichi_soft.core.errors import MeshError
from taichi_soft.meshing import (
    TetMesh,
    box,
    edge_owners,
    renumbered,
    spatial_order,
    sphere,
    tet_order,
)

pytestmark = pytest.mark.numpy

POINTS = hnp.arrays(
    float, st.tuples(st.integers(1, 60), st.just(3)), elements=st.floats(-1e6, 1e6, allow_subnormal=False)
)


@settings(max_examples=60)
@given(POINTS)
def test_spatial_order_is_a_permutation(points):
    order = spatial_order(points)
    assert order.dtype == np.int32
    assert sorted(order.tolist()) == list(range(len(points)))


def test_a_grid_of_powers_of_two_comes_in_morton_order():
    """The reference interleaves bits one by one in Python."""
    grid = np.indices((8, 8, 8)).reshape(3, -1).T

    def key(point):
        return sum(int(point[a]) >> bit & 1 and 1 << (3 * bit + 2 - a) for bit in range(3) for a in range(3))

    # Cells at the middle of their places, so that rounding cannot push one over an edge.
    expected = sorted(range(len(grid)), key=lambda i: key(grid[i]))
    ends = np.array([[-0.5, -0.5, -0.5], [7.5, 7.5, 7.5]])
    order = spatial_order(np.vstack([grid, ends]))
    assert [i for i in order.tolist() if i < len(grid)] == expected


def test_equal_points_keep_their_order():
    assert spatial_order(np.ones((5, 3))).tolist() == [0, 1, 2, 3, 4]


def test_order_does_not_depend_on_place_or_size():
    points = np.random.default_rng(0).integers(0, 1000, (200, 3)).astype(float)
    assert spatial_order(points * 4 + 1024).tolist() == spatial_order(points).tolist()


def test_renumbered_is_the_inverse():
    order = np.random.default_rng(0).permutation(50)
    assert renumbered(order)[order].tolist() == list(range(50))


def spread(tets):
    """Mean distance in memory between the first and last vertex of a tetrahedron, and between rows."""
    return np.ptp(tets, axis=1).mean(), np.abs(np.diff(tets.min(axis=1))).mean()


def test_ordering_a_shuffled_mesh_brings_neighbours_together():
    random = np.random.default_rng(0)
    mesh = sphere(1.0, 6)
    shuffle = random.permutation(len(mesh.vertices))
    vertices = mesh.vertices[shuffle]
    tets = random.permutation(renumbered(shuffle)[mesh.tets])

    order = spatial_order(vertices)
    rows = tet_order(tets, order)
    assert sorted(rows.tolist()) == list(range(len(tets)))
    local = renumbered(order)[tets[rows]]
    again = TetMesh(vertices[order], local)
    assert again.volume == pytest.approx(mesh.volume)
    assert spread(local)[0] < 0.5 * spread(tets)[0]
    assert spread(local)[1] < 0.01 * spread(tets)[1]


def test_tet_order_sorts_by_lowest_new_vertex():
    tets = [[0, 1, 2, 3], [1, 2, 3, 4]]
    assert tet_order(tets, [4, 3, 2, 1, 0]).tolist() == [1, 0]


def test_bad_input_is_refused():
    with pytest.raises(MeshError, match="vertex 0"):
        spatial_order([[np.nan, 0, 0]])
    with pytest.raises(MeshError, match="tetrahedron 0"):
        tet_order([[0, 1, 2, 9]], np.arange(5))


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), group=st.integers(1, 9))
def test_every_edge_is_owned_by_one_of_its_ends(seed, group):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 30))
    pairs = np.array([(p, q) for p in range(count) for q in range(p) if rng.random() < 0.4 or p == 1])
    owner = edge_owners(pairs, count, group)
    assert ((owner == pairs[:, 0]) | (owner == pairs[:, 1])).all()
    assert edge_owners(pairs, count, group).tolist() == owner.tolist()


@pytest.mark.parametrize("mesh", [sphere(1.0, 3), box((1, 1, 1), (8, 8, 8))])
def test_owned_edges_come_in_fuller_groups_than_by_the_lower_number(mesh):
    """The fill level of groups of 8 is compared."""

    def share(owner):
        counts = np.bincount(owner, minlength=len(mesh.vertices))
        return len(mesh.edges) / (np.ceil(counts / 8) * 8).sum()

    assert share(edge_owners(mesh.edges, len(mesh.vertices), 8)) > 1.15 * share(mesh.edges.min(axis=1))


def test_points_on_one_spot_keep_their_order():
    assert spatial_order(np.full((5, 3), 2.5)).tolist() == [0, 1, 2, 3, 4]
