"""Improved meshes: the same body, without the few tetrahedra that require short steps."""

import numpy as np
import pytest
from scipy.spatial import Delaunay

from taichi_soft import OptionError, TetMesh, box, sphere, torus
from taichi_soft.meshing.splitting import loose_parts

pytestmark = pytest.mark.numpy


def delaunay(points, keep=None):
    """Make a Delaunay mesh with all slivers of random points, except those that a mesh refuses."""
    tets = Delaunay(points).simplices
    x = points[tets]
    longest = np.linalg.norm(x[:, :, None] - x[:, None], axis=3).max(axis=(1, 2))
    solid = np.abs(np.linalg.det(x[:, 1:] - x[:, :1])) > 6e-6 * longest**3
    tets = tets[solid if keep is None else solid & keep(x.mean(axis=1))]
    used, numbers = np.unique(tets, return_inverse=True)
    return TetMesh(points[used], numbers.reshape(-1, 4), fix_orientation=True)


def in_a_ball(rng, count=220):
    direction = rng.normal(size=(count, 3))
    return direction / np.linalg.norm(direction, axis=1, keepdims=True) * rng.random((count, 1)) ** (1 / 3)


def grid_with_rounding(rng):
    """The eight corners of a cube lie on one sphere: which tetrahedra they make is left to the rounding."""
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 5)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    return grid + 1e-3 * rng.random(grid.shape)


def tunnel(centres):
    return (np.abs(centres[:, :2] - 0.5) > 0.2).any(axis=1)


MESHES = {
    "ball": lambda rng: delaunay(in_a_ball(rng)),
    "box": lambda rng: delaunay(rng.random((150, 3))),
    "graded box": lambda rng: delaunay(rng.random((150, 3)) ** (2, 1, 1)),
    "grid": lambda rng: delaunay(grid_with_rounding(rng)),
    "ragged tunnel": lambda rng: delaunay(rng.random((200, 3)), tunnel),
}


@pytest.fixture(scope="module", params=MESHES)
def pair(request):
    mesh = MESHES[request.param](np.random.default_rng(1))
    return mesh, *mesh.improved(return_source=True)


def gradients(mesh):
    """Return the gradients of the shape functions, (m, 4, 3) [1/m]."""
    ones = np.ones((len(mesh.tets), 4, 1))
    return np.swapaxes(np.linalg.inv(np.concatenate([ones, mesh.vertices[mesh.tets]], axis=2))[:, 1:], 1, 2)


def signed_volumes(mesh):
    x = mesh.vertices[mesh.tets]
    return np.linalg.det(x[:, 1:] - x[:, :1]) / 6


def highest_frequency2(mesh, poisson=0.3):
    """Return the square of the highest angular frequency per E / density.

    The model is linear elasticity with lumped masses. The eigenvalue problem is dense.
    """
    lam, mu = poisson / (1 + poisson) / (1 - 2 * poisson), 0.5 / (1 + poisson)
    g, volume, n = gradients(mesh), signed_volumes(mesh), len(mesh.vertices)
    stiffness, mass = np.zeros((n, 3, n, 3)), np.zeros(n)
    for tet, b, v in zip(mesh.tets, g, volume, strict=True):
        block = lam * np.einsum("ia,jb->iajb", b, b) + mu * np.einsum("ib,ja->iajb", b, b)
        block += mu * np.einsum("ic,jc,ab->iajb", b, b, np.eye(3))
        stiffness[np.ix_(tet, range(3), tet, range(3))] += v * block
        mass[tet] += v / 4
    root = np.repeat(np.sqrt(mass), 3)
    return np.linalg.eigvalsh(stiffness.reshape(3 * n, 3 * n) / root / root[:, None])[-1]


def distance(points, triangles):
    """Return the distance of each point (k, 3) from the nearest of triangles (f, 3, 3) [m]."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    normal = np.cross(b - a, c - a)
    arm = points[:, None] - a
    s = np.einsum("kfd,fd->kf", np.cross(arm, c - a), normal) / (normal**2).sum(axis=1)
    t = np.einsum("kfd,fd->kf", np.cross(b - a, arm), normal) / (normal**2).sum(axis=1)
    inside = (s >= 0) & (t >= 0) & (s + t <= 1)
    height = np.abs(np.einsum("kfd,fd->kf", arm, normal)) / np.linalg.norm(normal, axis=1)
    nearest = np.where(inside, height, np.inf)
    for p, q in ((a, b), (b, c), (c, a)):
        share = np.einsum("kfd,fd->kf", points[:, None] - p, q - p) / ((q - p) ** 2).sum(axis=1)
        foot = p + np.clip(share, 0, 1)[:, :, None] * (q - p)
        nearest = np.minimum(nearest, np.linalg.norm(points[:, None] - foot, axis=2))
    return nearest.min(axis=1)


def surface_distance(first, second):
    """Largest distance between two surfaces, either way, at 21 points of every triangle [m]."""
    lattice = np.array([(i, j, 5 - i - j) for i in range(6) for j in range(6 - i)]) / 5
    sides = [mesh.vertices[mesh.surface] for mesh in (first, second)]
    largest = 0.0
    for here, there in (sides, sides[::-1]):
        points = np.einsum("sc,tcd->tsd", lattice, here).reshape(-1, 3)
        for start in range(0, len(points), 500):
            largest = max(largest, float(distance(points[start : start + 500], there).max()))
    return largest


def euler_characteristics(mesh):
    """Return the Euler characteristics of the body and of its surface."""
    faces = {
        frozenset(face) for tet in mesh.tets.tolist() for face in (tet[1:], tet[:3], tet[::3] + tet[2:3])
    }
    faces |= {frozenset((tet[0], tet[1], tet[3])) for tet in mesh.tets.tolist()}
    edges = {frozenset((face[i - 1], face[i])) for face in mesh.surface.tolist() for i in range(3)}
    body = len(mesh.vertices) - len(mesh.edges) + len(faces) - len(mesh.tets)
    return body, len(np.unique(mesh.surface)) - len(edges) + len(mesh.surface)


def test_the_stable_step_of_meshes_with_slivers_grows_several_times(pair):
    before, after, _ = pair
    assert highest_frequency2(before) > 2.5**2 * highest_frequency2(after)
    worst = [(gradients(mesh) ** 2).sum(axis=(1, 2)).max() for mesh in (before, after)]
    assert worst[0] > 15**2 * worst[1]


def test_the_body_stays_what_it_was(pair):
    before, after, _ = pair
    volumes = signed_volumes(after)
    assert volumes.min() > 0
    assert volumes.sum() == pytest.approx(signed_volumes(before).sum(), rel=0.01)
    tolerance = min(0.25 * before.edge_lengths.mean(), 0.01 * np.linalg.norm(np.ptp(before.bounds, axis=0)))
    assert 0 < surface_distance(before, after) <= tolerance
    assert euler_characteristics(after) == euler_characteristics(before)
    parts = [loose_parts(mesh.tets, len(mesh.vertices)).max() for mesh in (before, after)]
    assert parts[0] == parts[1]


def test_what_was_given_per_tetrahedron_can_be_carried_over(pair):
    """Each lies where its source was, so what varies over the body still does so in the same way."""
    before, after, source = pair
    assert source.dtype == np.int32
    assert len(source) == len(after.tets)
    centres = [mesh.vertices[mesh.tets].mean(axis=1) for mesh in (before, after)]
    shift = np.linalg.norm(centres[0][source] - centres[1], axis=1)
    longest = before.edge_lengths.max()
    assert shift.max() < longest
    values = 1000 + 500 * np.sin(4 * centres[0][:, 0])
    total = [values @ before.volumes, values[source] @ after.volumes]
    assert total[1] == pytest.approx(total[0], rel=0.015)


def test_every_run_gives_the_same_and_size_does_not_count(pair):
    before, after, source = pair
    again, second = before.scaled(2.0**-9).improved(return_source=True)
    np.testing.assert_array_equal(again.tets, after.tets)
    np.testing.assert_array_equal(again.vertices * 2**9, after.vertices)
    np.testing.assert_array_equal(second, source)


@pytest.mark.parametrize("mesh", [box((2.0, 0.5, 0.5), (8, 2, 2)), sphere(0.5, 3), torus()], ids=repr)
def test_a_good_mesh_comes_back_unchanged(mesh):
    better, source = mesh.improved(return_source=True)
    assert better is mesh
    np.testing.assert_array_equal(source, np.arange(len(mesh.tets)))


def test_four_points_in_a_plane_lose_their_sliver_and_nothing_else_moves():
    """The mesh is an octahedron whose middle square is slightly bent, with a flat tetrahedron in the bend."""
    bend = 0.01
    vertices = [(1, 0, bend), (-1, 0, bend), (0, 1, -bend), (0, -1, -bend), (0, 0, 1), (0, 0, -1)]
    tets = [(0, 1, 2, 3), (0, 1, 2, 4), (0, 1, 3, 4), (2, 3, 0, 5), (2, 3, 1, 5)]
    mesh = TetMesh(np.array(vertices, dtype=float), tets, fix_orientation=True)
    better, source = mesh.improved(return_source=True)
    np.testing.assert_array_equal(better.vertices, mesh.vertices)
    assert len(better.tets) == 4
    assert better.quality.min_dihedral.min() > 50
    assert {frozenset(row) for row in better.surface.tolist()} == {
        frozenset(row) for row in mesh.surface.tolist()
    }
    assert better.volume == pytest.approx(mesh.volume, rel=1e-14)
    # The four lie above or below the square, where their sources were.
    above = [m.vertices[m.tets].mean(axis=1)[:, 2] > 0 for m in (mesh, better)]
    np.testing.assert_array_equal(above[0][source[source > 0]], above[1][source > 0])


def test_holes_and_slits_far_narrower_than_the_tolerance_stay_open():
    """Collapsing the short edges around a narrow tunnel or across a slit would close it."""
    turn = 2 * np.pi / 3 * np.arange(3)
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    flat = np.concatenate([0.05 * ring, ring, -ring])
    points = np.concatenate([np.c_[flat, np.full(9, z)] for z in np.linspace(0, 1, 6)])
    points += 1e-3 * np.random.default_rng(0).random(points.shape)
    mesh = delaunay(points, lambda centres: np.linalg.norm(centres[:, :2], axis=1) > 0.02)
    better = mesh.improved(min_size=0.3, tolerance=0.1)
    assert len(better.tets) < 0.7 * len(mesh.tets)
    assert euler_characteristics(better) == euler_characteristics(mesh)


def test_a_smaller_least_size_and_a_tighter_tolerance_are_kept():
    mesh = MESHES["ball"](np.random.default_rng(1))
    size = np.sqrt(6 / (gradients(mesh) ** 2).sum(axis=(1, 2)))  # the edge, for a regular tetrahedron
    assert mesh.improved(min_size=0.99 * size.min()) is mesh
    second = np.sort(size)[1]
    one = mesh.improved(min_size=second)
    assert np.sqrt(6 / (gradients(one) ** 2).sum(axis=(1, 2))).min() == pytest.approx(second, rel=0.02)
    assert len(set(map(tuple, mesh.vertices)) - set(map(tuple, one.vertices))) <= 2
    tight = mesh.improved(tolerance=1e-3)
    assert 0 < surface_distance(mesh, tight) <= 1e-3


@pytest.mark.parametrize("bad", [0, -1.0, np.nan, np.inf, "small", True])
@pytest.mark.parametrize("name", ["min_size", "tolerance"])
def test_sizes_that_are_none_are_refused(name, bad):
    with pytest.raises(OptionError, match=name):
        box((1.0, 1.0, 1.0), (1, 1, 1)).improved(**{name: bad})
