"""Voronoi graphs: cells divide the volume, faces have the correct position, and bad meshes are refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taichi_soft import (
    MeshError,
    OptionError,
    TetMesh,
    box,
    cylinder,
    delaunay_mesh,
    load_mesh,
    sphere,
    torus,
    voronoi_graph,
)
from taichi_soft.core.package_data import ASSETS
from taichi_soft.meshing import delaunay
from taichi_soft.meshing.delaunay import circumspheres, require_delaunay

pytestmark = pytest.mark.numpy

CORNER = TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]], [[0, 1, 2, 3]])


def random_mesh(seed, count=40):
    """Delaunay mesh of random points, slivers and all: convex."""
    from scipy.spatial import Delaunay

    points = np.random.default_rng(seed).uniform(size=(count, 3))
    tets = Delaunay(points).simplices
    corners = points[tets]
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    if volume.min() < 1e-6:
        tets = tets[volume >= 1e-6]
    return TetMesh(points, tets, fix_orientation=True)


def u_shape():
    """A U of cubes: its hull is not convex, and cells reach across the gap only outside of it."""
    bar = box((3.0, 1.0, 3.0), (3, 1, 3))
    middle = bar.vertices[bar.tets].mean(axis=1)
    gap = (middle[:, 0] > 1) & (middle[:, 0] < 2) & (middle[:, 2] > 1)
    if not gap.any():  # the box may be centred
        gap = (np.abs(middle[:, 0]) < 0.5) & (middle[:, 2] > np.median(bar.vertices[:, 2]) - 0.5)
    kept = bar.tets[~gap]
    used, flat = np.unique(kept, return_inverse=True)
    return TetMesh(bar.vertices[used], flat.reshape(-1, 4))


MESHES = {
    "corner": CORNER,
    "cube": box((1, 1, 1), (1, 1, 1)),
    "lattice": box((2, 1, 1), (4, 2, 2)),
    "ball": sphere(1.0, 2),
    "cylinder": cylinder(1.0, 2.0),
    "torus": torus(1.0, 0.4, 2, 8),
    "U": u_shape(),
    "random": random_mesh(1),
}


@pytest.fixture(scope="module")
def graphs():
    return {name: voronoi_graph(mesh) for name, mesh in MESHES.items()}


@pytest.mark.parametrize("name", MESHES)
def test_cells_share_out_the_volume_of_the_body_and_of_each_tetrahedron(name, graphs):
    mesh, graph = MESHES[name], graphs[name]
    assert graph.cell_volume.sum() == pytest.approx(mesh.volume, rel=1e-10)
    per_tet = np.bincount(graph.cell_tet, graph.cell_volume, len(mesh.tets))
    np.testing.assert_allclose(per_tet, mesh.volumes, rtol=1e-8)
    assert graph.cell_volume.min() > -1e-12 * mesh.volume


@pytest.mark.parametrize("name", MESHES)
def test_masses_sum_to_density_times_volume_also_of_many_densities(name, graphs):
    mesh = MESHES[name]
    density = np.random.default_rng(0).uniform(100, 2000, len(mesh.tets))
    masses = graphs[name].masses(density)
    assert masses.min() > 0
    assert masses.sum() == pytest.approx(density @ mesh.volumes, rel=1e-10)


@pytest.mark.parametrize("name", ["lattice", "ball", "U", "random"])
def test_a_cell_holds_what_is_nearest_to_its_particle(name, graphs):
    """The reference assigns random points in the body to their nearest vertex."""
    mesh, graph = MESHES[name], graphs[name]
    rng = np.random.default_rng(0)
    count = 200_000
    tets = rng.choice(len(mesh.tets), size=count, p=mesh.volumes / mesh.volume)
    weights = rng.dirichlet(np.ones(4), size=count)
    points = np.einsum("pi,pia->pa", weights, mesh.vertices[mesh.tets[tets]])
    nearest = np.empty(count, dtype=int)
    for start in range(0, count, 10_000):
        gaps = points[start : start + 10_000, None] - mesh.vertices[None]
        nearest[start : start + 10_000] = (gaps**2).sum(axis=2).argmin(axis=1)
    share = np.bincount(nearest, minlength=len(mesh.vertices)) / count
    volumes = graph.masses(np.ones(len(mesh.tets))) / mesh.volume
    np.testing.assert_allclose(volumes, share, atol=5 * np.sqrt(share.max() / count))


def test_a_regular_lattice_has_square_faces_between_its_cubes(graphs):
    """Halves at the surface, quarters at its edges; the diagonals have none."""
    mesh, graph = MESHES["lattice"], graphs["lattice"]
    ends = mesh.vertices[mesh.edges]
    d = np.abs(ends[:, 1] - ends[:, 0])
    straight = (d > 1e-9).sum(axis=1) == 1
    assert (graph.areas[~straight] == 0).all()
    low, high = mesh.bounds
    middle = ends.mean(axis=1)
    on_side = ((np.abs(middle - low) < 1e-9) | (np.abs(middle - high) < 1e-9)).sum(axis=1)
    np.testing.assert_allclose(graph.areas[straight], 0.25 * 0.5 ** on_side[straight], rtol=1e-7)
    volumes = graph.masses(np.ones(len(mesh.tets)))
    sides = ((np.abs(mesh.vertices - low) < 1e-9) | (np.abs(mesh.vertices - high) < 1e-9)).sum(axis=1)
    np.testing.assert_allclose(volumes, 0.125 * 0.5**sides, rtol=1e-7)


def test_one_corner_of_a_cube_has_the_faces_of_the_cube_and_no_others(graphs):
    """Its circumcentre lies on the far side: faces of the slanted edges are clipped away entirely."""
    graph = graphs["corner"]
    areas = {tuple(edge): area for edge, area in zip(CORNER.edges.tolist(), graph.areas, strict=True)}
    # The plane x = 1/2 cuts the corner in a right triangle with legs 1/2, of which the planes y = x and z = x
    # (nearer to the other vertices where y or z exceeds x) leave everything.
    for j in (1, 2, 3):
        assert areas[0, j] == pytest.approx(1 / 8, rel=1e-6)
    for edge in ((1, 2), (1, 3), (2, 3)):
        assert areas[edge] == 0
    assert graph.masses(np.ones(1))[0] == pytest.approx(1 / 6 - 3 / 48, rel=1e-6)


@pytest.mark.parametrize("name", MESHES)
def test_corners_run_round_their_face_at_right_angles_to_the_edge(name, graphs):
    """Half the sum of cross products is the area, along the edge; corners lie inside their tetrahedra."""
    mesh, graph = MESHES[name], graphs[name]
    corners = graph.corners()
    assert graph.corner_weights.min() > -1e-6
    np.testing.assert_allclose(graph.corner_weights.sum(axis=1), 1.0, atol=1e-12)
    for e in np.flatnonzero(graph.areas > 0):
        p, q = mesh.vertices[mesh.edges[e]]
        rows = np.flatnonzero(graph.corner_edge == e)
        loop = corners[rows] - (p + q) / 2
        assert np.allclose(loop[0], loop[-1])
        vector = 0.5 * np.cross(loop[:-1], loop[1:]).sum(axis=0)
        length = np.linalg.norm(q - p)
        np.testing.assert_allclose(vector, graph.areas[e] * (q - p) / length, atol=1e-7 * length**2)
        assert np.abs(loop @ (q - p)).max() < 1e-6 * length**2


def test_inside_a_random_body_corners_are_the_centres_of_circumspheres(graphs):
    mesh, graph = MESHES["random"], graphs["random"]
    centers, _ = circumspheres(mesh)
    outer = set(map(tuple, np.sort(mesh.surface[:, [0, 1]], axis=1).tolist()))
    outer |= set(map(tuple, np.sort(mesh.surface[:, [1, 2]], axis=1).tolist()))
    outer |= set(map(tuple, np.sort(mesh.surface[:, [0, 2]], axis=1).tolist()))
    low, high = mesh.bounds
    checked = 0
    for e, edge in enumerate(map(tuple, mesh.edges.tolist())):
        ring = [t for t, tet in enumerate(mesh.tets.tolist()) if set(edge) <= set(tet)]
        inside = ((centers[ring] > low + 0.1) & (centers[ring] < high - 0.1)).all()
        if edge in outer or not inside:
            continue
        corners = graph.corners()[graph.corner_edge == e][:-1]
        gaps = np.linalg.norm(corners[:, None] - centers[ring][None], axis=2).min(axis=1)
        if len(corners) == len(ring):  # otherwise the surface has cut a corner off
            assert gaps.max() < 1e-6
            checked += 1
    assert checked >= 3


@settings(max_examples=10)
@given(seed=st.integers(0, 10_000))
def test_random_bodies_with_slivers_are_shared_out_too(seed):
    mesh = random_mesh(seed, 25)
    graph = voronoi_graph(mesh)
    assert graph.cell_volume.sum() == pytest.approx(mesh.volume, rel=1e-10)


@pytest.mark.parametrize("name", ["cube", "bars", "cylinder_flat"])
def test_assets_that_are_delaunay(name):
    mesh = load_mesh(ASSETS / f"{name}.npz")
    assert voronoi_graph(mesh).cell_volume.sum() == pytest.approx(mesh.volume, rel=1e-10)


def test_a_mesh_that_is_not_delaunay_is_refused_and_can_be_reconnected():
    mesh = load_mesh(ASSETS / "cylinder_long.npz")
    with pytest.raises(MeshError, match=r"vertex \d+ .*tetrahedron \d+ .*delaunay_mesh"):
        voronoi_graph(mesh)
    made = delaunay_mesh(mesh)
    require_delaunay(made)
    assert np.array_equal(made.vertices, mesh.vertices)
    assert made.volume == pytest.approx(mesh.volume, rel=1e-9)
    assert voronoi_graph(made).cell_volume.sum() == pytest.approx(mesh.volume, rel=1e-10)


def test_a_surface_that_no_delaunay_mesh_has_is_refused():
    """The triangles of this sphere are not those of the hull of its vertices."""
    mesh = load_mesh(ASSETS / "sphere.npz")
    with pytest.raises(MeshError, match=r"4\.00\d+ m\^3 .*4: .*more vertices"):
        delaunay_mesh(mesh)


def test_without_scipy_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "scipy", None)
    with pytest.raises(OptionError, match=r"pip install 'taichi-soft\[voronoi\]'"):
        delaunay.scipy_spatial()


@pytest.mark.parametrize("call", [voronoi_graph, delaunay_mesh])
def test_what_is_no_mesh_is_refused(call):
    with pytest.raises(MeshError, match="TetMesh"):
        call("ball")


def test_far_from_the_origin_nothing_is_lost():
    mesh = box((1, 1, 1), (2, 2, 2))
    near, far = voronoi_graph(mesh), voronoi_graph(mesh.translated((1e5, 0, 0)))
    np.testing.assert_allclose(far.areas, near.areas, atol=1e-8)
    assert far.cell_volume.sum() == pytest.approx(mesh.volume, rel=1e-9)


def test_a_mesh_has_one_graph():
    mesh = box((1, 1, 1), (2, 2, 2))
    assert voronoi_graph(mesh) is voronoi_graph(mesh)
    assert voronoi_graph(mesh) is not voronoi_graph(box((1, 1, 1), (2, 2, 2)))
