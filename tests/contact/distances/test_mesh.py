"""Distance grids of closed meshes, against closed forms and distances from all triangles in float64."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import Delaunay
from trimesh.triangles import closest_point

from taichi_soft import MeshShape
from taichi_soft import box as lattice_box

pytestmark = pytest.mark.kernel

TURN = trimesh.transformations.euler_matrix(0.4, -0.7, 1.1)


def turned_box():
    mesh = trimesh.creation.box((1.0, 0.6, 0.8))
    mesh.apply_transform(TURN)
    return mesh


def bowl():
    """Half a ball with a wall of 3 cells, off the origin."""
    angle = np.linspace(0, np.pi / 2, 7)
    outer = np.stack([np.sin(angle), -np.cos(angle)], axis=1)
    profile = np.concatenate([outer, 0.9 * outer[::-1]])
    mesh = trimesh.creation.revolve(profile, sections=16)
    mesh.apply_translation((3.0, -2.0, 1.0))
    return mesh


MESHES = {
    "ball": trimesh.creation.icosphere(subdivisions=1, radius=0.5),
    "box along the axes": trimesh.creation.box((1.0, 0.6, 0.8)),
    "turned box": turned_box(),
    "ring": trimesh.creation.torus(0.8, 0.25, 16, 10),
    "bowl": bowl(),
}


@pytest.fixture(scope="module", params=MESHES)
def case(request):
    mesh = MESHES[request.param]
    return mesh, MeshShape(mesh, cell=mesh.extents.max() / 60, cache=False)


def distance_to_triangles(mesh, x):
    best = np.full(len(x), np.inf)
    for corners in mesh.triangles:
        near = closest_point(np.broadcast_to(corners, (len(x), 3, 3)), x)
        best = np.minimum(best, np.linalg.norm(x - near, axis=1))
    return best


def is_inside(mesh, x):
    """True for points inside a surface, by the solid angle of the triangles (van Oosterom and Strackee)."""
    angle = np.zeros(len(x))
    for corners in mesh.triangles:
        a, b, c = (corner - x for corner in corners)
        la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
        over = np.einsum("ij,ij->i", a, np.cross(b, c))
        under = la * lb * lc + lc * (a * b).sum(1) + la * (b * c).sum(1) + lb * (c * a).sum(1)
        angle += 2 * np.arctan2(over, under)
    return angle > 2 * np.pi


def signed_distance_to(mesh, x):
    return np.where(is_inside(mesh, x), -1, 1) * distance_to_triangles(mesh, x)


def points_round(mesh, seed, count, margin=0.02):
    low, high = mesh.bounds
    rng = np.random.default_rng(seed)
    return rng.uniform(low - margin, high + margin, (count, 3)).astype(np.float32).astype(np.float64)


def test_nodes_have_the_exact_distance_and_sign(case):
    mesh, shape = case
    numbers = np.random.default_rng(1).choice(len(shape.samples), 600, replace=False)
    low = shape.parameters[:3].astype(np.float64)
    x = low + shape.cell * np.stack(np.unravel_index(numbers, shape.resolution), axis=1)
    wanted = signed_distance_to(mesh, x)
    found = shape.samples[numbers]
    np.testing.assert_allclose(np.abs(found), np.abs(wanted), atol=1e-5 * mesh.extents.max())
    clear = np.abs(wanted) > 1e-3 * shape.cell
    assert (np.sign(found) == np.sign(wanted))[clear].all()


def surface_of(tets):
    """Return the faces that belong to one tetrahedron only, facing outwards."""
    faces = tets[:, [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]].reshape(-1, 3)
    _, first, uses = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return faces[first[uses == 1]]


def slit(vertices, triangles, count, rng):
    """Return the surface with T-junctions: an edge is split on one side, and a flat sliver fills the gap."""
    vertices, triangles = list(vertices), [tuple(each) for each in triangles]
    for _ in range(count):
        number, turn = rng.integers(len(triangles)), rng.integers(3)
        a, b, c = np.roll(triangles[number], turn)
        middle, share = len(vertices), rng.uniform(0.1, 0.9)
        vertices.append((1 - share) * vertices[a] + share * vertices[b])
        triangles[number] = (a, middle, c)
        triangles += [(middle, b, c), (a, b, middle)]
    return np.array(vertices), np.array(triangles)


def sliver_at_a_junction(rng):
    """Make a corner of a cube. One of its vertical edges has an extra vertex on one side."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0.5]])
    triangles = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 4, 2], [4, 3, 2], [0, 3, 4]])
    return vertices, np.array([[0, 1, 2, 3]]), (vertices, triangles)


def random_tetrahedra(rng):
    """Return some Delaunay tetrahedra of random points. Half of the points are vertically above others."""
    points = rng.uniform(size=(14, 3))
    points = np.concatenate([points, points[:7] * (1, 1, 0) + (0, 0, 1) * rng.uniform(size=(7, 1))])
    tets = Delaunay(points).simplices
    volumes = np.linalg.det(points[tets[:, 1:]] - points[tets[:, :1]])
    tets[volumes < 0] = tets[volumes < 0][:, [1, 0, 2, 3]]
    tets = tets[np.abs(volumes) > 1e-6]
    tets = tets[rng.uniform(size=len(tets)) < 0.7]
    return points, tets, slit(points, surface_of(tets), 60, rng)


def random_blocks(rng):
    """Return random cubes of a stack of 27. They share faces, edges, corners or nothing."""
    mesh = lattice_box((1.0, 0.9, 1.1), (3, 3, 3))
    tets = mesh.tets.reshape(27, -1, 4)[rng.uniform(size=27) < 0.5].reshape(-1, 4)
    return mesh.vertices, tets, slit(mesh.vertices, surface_of(tets), 60, rng)


def is_in_any(vertices, tets, x):
    """True for points in any tetrahedron, by barycentric coordinates in float64."""
    inside = np.zeros(len(x), dtype=bool)
    for corners in vertices[tets]:
        shares = np.linalg.solve((corners[1:] - corners[0]).T, (x - corners[0]).T)
        inside |= (shares >= 0).all(axis=0) & (shares.sum(axis=0) <= 1)
    return inside


@pytest.mark.parametrize(
    ("make", "seed"),
    [(sliver_at_a_junction, 0), *((random_tetrahedra, seed) for seed in (1, 8, 17))]
    + [(random_blocks, seed) for seed in range(3)],
)
def test_slivers_at_junctions_change_no_distance_and_no_sign(make, seed):
    """Along z, slivers on vertical edges project to one point."""
    rng = np.random.default_rng(seed)
    vertices, tets, surface = make(rng)
    corners = surface[0][surface[1]]
    assert (np.ptp(corners[:, :, :2], axis=1).max(axis=1) < 1e-9).any()
    shape = MeshShape(surface, cell=1 / 60, cache=False)
    numbers = rng.choice(len(shape.samples), 600, replace=False)
    low = shape.parameters[:3].astype(np.float64)
    x = low + shape.cell * np.stack(np.unravel_index(numbers, shape.resolution), axis=1)
    wanted = distance_to_triangles(trimesh.Trimesh(*surface, process=False), x)
    found = shape.samples[numbers].astype(np.float64)
    np.testing.assert_allclose(np.abs(found), wanted, atol=1e-5)
    clear = wanted > 1e-3 * shape.cell
    np.testing.assert_array_equal((found < 0)[clear], is_in_any(vertices, tets, x)[clear])


def test_between_nodes_distances_are_right_to_a_fraction_of_a_cell(case, measure):
    mesh, shape = case
    x = points_round(mesh, 2, 800)
    wanted = signed_distance_to(mesh, x)
    distance, normal = measure(shape, x)
    np.testing.assert_allclose(shape.depths(x), -distance, atol=1e-5)
    error = np.abs(distance - wanted) / shape.cell
    assert error.max() < 0.6
    assert np.quantile(error, 0.9) < 0.1
    assert np.median(error) < 0.005
    clear = np.abs(wanted) > 0.3 * shape.cell
    assert (np.sign(distance) == np.sign(wanted))[clear].all()
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-6)


def test_flat_faces_are_exact(measure):
    """Trilinear interpolation reproduces linear functions, so distances away from edges are exact."""
    mesh = MESHES["turned box"]
    shape = MeshShape(mesh, cache=False)
    rng = np.random.default_rng(3)
    local = rng.uniform(-0.2, 0.2, (500, 3))
    local[:, 1] = 0.3 + rng.uniform(-2, 2, 500) * shape.cell
    distance, normal = measure(shape, local @ TURN[:3, :3].T)
    np.testing.assert_allclose(distance, local[:, 1] - 0.3, atol=1e-5)
    np.testing.assert_allclose(normal, np.broadcast_to(TURN[:3, 1], (500, 3)), atol=1e-3)


def test_a_fine_ball_has_the_distance_of_a_ball(measure):
    """The error is at most 1 mm for a ball of 1 m and cells of 16 mm. Normals point away from the centre."""
    shape = MeshShape(trimesh.creation.icosphere(subdivisions=4, radius=0.5), cache=False)
    rng = np.random.default_rng(4)
    x = rng.normal(size=(2000, 3))
    x *= (rng.uniform(0.3, 0.53, 2000) / np.linalg.norm(x, axis=1))[:, None]
    distance, normal = measure(shape, x)
    radius = np.linalg.norm(x, axis=1)
    np.testing.assert_allclose(distance, radius - 0.5, atol=1e-3)
    np.testing.assert_allclose(normal, x / radius[:, None], atol=0.05)


def star():
    """Make a ball with twelve long spikes."""
    mesh = trimesh.creation.icosphere(subdivisions=1, radius=0.2)
    vertices = np.array(mesh.vertices)
    vertices[:12] *= 4
    return trimesh.Trimesh(vertices, mesh.faces)


def hollow():
    """Make a box with a cavity whose corners point outwards."""
    cavity = trimesh.creation.icosphere(subdivisions=0, radius=0.4)
    cavity.invert()
    return trimesh.util.concatenate([trimesh.creation.box((1, 1, 1)), cavity])


@pytest.mark.parametrize("make", [star, hollow])
def test_a_step_by_the_distance_ends_outside(make, measure):
    """A step in any direction ends outside, to a tenth of a cell. Some start near corners and edges."""
    mesh = make()
    shape = MeshShape(mesh, cache=False)
    rng = np.random.default_rng(10)
    x = mesh.triangles[rng.integers(0, len(mesh.faces), 30000)]
    x = np.einsum("nij,ni->nj", x, rng.dirichlet((0.3, 0.3, 0.3), len(x)))
    x += rng.uniform(-4, 4, x.shape) * shape.cell
    distance, _ = measure(shape, x)
    x, distance = x[distance > 0], distance[distance > 0]
    assert len(x) > 5000
    for _ in range(10):
        way = rng.normal(size=x.shape)
        way /= np.linalg.norm(way, axis=1)[:, None]
        assert (measure(shape, x + distance[:, None] * way)[0] > -0.1 * shape.cell).all()


def test_in_the_middle_of_a_solid_the_normal_is_up(measure):
    """At the centre, all ways out are equally long.

    The slope is 0, because the eight nodes around it are equal.
    """
    shape = MeshShape(trimesh.creation.box((1, 1, 1)), cell=1 / 9, cache=False)
    distance, normal = measure(shape, [[0.0, 0.0, 0.0]])
    assert distance[0] == pytest.approx(-4 / 9, abs=1e-6)
    np.testing.assert_allclose(normal[0], [0, 0, 1], atol=1e-6)


def test_beyond_the_grid_the_faces_of_a_box_are_as_far_as_they_are(measure):
    mesh = MESHES["box along the axes"]
    shape = MeshShape(mesh, cell=1 / 60, cache=False)
    away = np.geomspace(0.05, 100, 40)
    for axis in range(3):
        x = np.tile([0.1, -0.2, 0.15], (40, 1))
        x[:, axis] = mesh.extents[axis] / 2 + away
        distance, _ = measure(shape, x)
        np.testing.assert_allclose(distance, away, rtol=1e-5)


def test_normals_are_the_direction_in_which_the_distance_rises(case, measure):
    """The reference is central differences within one cell, where the interpolation is smooth."""
    mesh, shape = case
    x = points_round(mesh, 5, 2000, margin=0.0)
    step = 0.02 * shape.cell
    place = (x - shape.parameters[:3]) / shape.cell % 1
    x = x[((place > 0.05) & (place < 0.95)).all(axis=1)]
    distance, normal = measure(shape, x)
    x = x[np.abs(distance) < 3 * shape.cell]
    normal = normal[np.abs(distance) < 3 * shape.cell]
    sides = [[measure(shape, x + s * e)[0] for s in (step, -step)] for e in np.eye(3)]
    gradient = np.stack([(up - down) / (2 * step) for up, down in sides], axis=1)
    slope = np.linalg.norm(gradient, axis=1)
    regular = slope > 0.5
    assert regular.mean() > 0.9
    cosine = (gradient * normal).sum(axis=1)[regular] / slope[regular]
    assert np.quantile(cosine, 0.02) > 0.99


def test_outside_the_grid_distances_are_no_larger_and_not_much_smaller(case, measure):
    mesh, shape = case
    low, high = mesh.bounds
    rng = np.random.default_rng(6)
    x = (low + high) / 2 + rng.uniform(-3, 3, (800, 3)) * mesh.extents.max()
    x = x[((x < low) | (x > high)).any(axis=1)].astype(np.float32).astype(np.float64)
    wanted = distance_to_triangles(mesh, x)
    distance, normal = measure(shape, x)
    assert (distance <= wanted + 0.5 * shape.cell).all()
    assert (distance > 0.7 * wanted - shape.cell).all()
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-6)


def test_odd_places_have_unit_normals_and_read_no_foreign_sample(case, measure):
    """In this test, samples of other shapes are NaN."""
    mesh, shape = case
    lattice = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3), axis=-1).reshape(-1, 3) * 1.0
    low = shape.parameters[:3].astype(np.float64)
    high = low + shape.cell * (np.array(shape.resolution) - 1)
    corners = np.where(lattice > 0, high, np.where(lattice < 0, low, (low + high) / 2))
    x = np.concatenate([mesh.vertices, mesh.centroid + 0 * lattice, corners, corners + 1e-6 * lattice])
    x = np.concatenate([x, 9.9e6 * lattice])
    distance, normal = measure(shape, x)
    assert np.isfinite(distance).all()
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-6)


def test_a_ray_that_goes_on_by_the_distance_passes_no_wall(case, measure):
    """No point before the end of the ray is deeper than half a cell, and the ray ends at the wall."""
    mesh, shape = case
    start, end = points_round(mesh, 7, 150, margin=0.6), points_round(mesh, 8, 150, margin=0.6)
    start = start[measure(shape, start)[0] > 0]
    end = end[: len(start)]
    length = np.linalg.norm(end - start, axis=1)
    gone = np.zeros(len(start))
    for _ in range(150):
        x = start + (gone / length)[:, None] * (end - start)
        distance, _ = measure(shape, x)
        gone = np.minimum(gone + np.maximum(distance, 0), length)
    stopped = gone < length
    assert 25 < stopped.sum() < len(start)
    passed = start[None] + np.linspace(0, 1, 25)[:, None, None] * (x - start)[None]
    depth = -signed_distance_to(mesh, passed.reshape(-1, 3)).reshape(25, -1) / shape.cell
    assert depth.max() < 0.5
    assert depth[-1, stopped].min() > -0.5


@pytest.mark.parametrize("cells", [1.2, 1.5, 2.0, 3.0])
@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (0.2, 0.3, 0.1), (0.8, 0.1, 0.6)])
def test_no_ray_passes_a_plate_that_is_thick_enough_to_be_taken(cells, turn, measure):
    """Rays cross the plate at any angle.

    Their ends are outside, on opposite sides, by the closed form of a box.
    """
    cell = 1 / 64
    mesh = trimesh.creation.box((1, 1, cells * cell))
    matrix = trimesh.transformations.euler_matrix(*turn)
    mesh.apply_transform(matrix)
    shape = MeshShape(mesh, cell=cell, cache=False)
    rng = np.random.default_rng(9)
    middle = np.zeros((2000, 3))
    middle[:, :2] = rng.uniform(-0.45, 0.45, (2000, 2))
    way = rng.normal(size=(2000, 3)) * (1, 1, 0.5)
    way *= (0.3 / np.linalg.norm(way, axis=1))[:, None]
    steep = np.abs(way[:, 2]) > 0.6 * cells * cell
    start, way = (middle - way)[steep] @ matrix[:3, :3].T, 2 * way[steep] @ matrix[:3, :3].T
    gone = np.zeros(len(start))
    for _ in range(100):
        distance, _ = measure(shape, start + gone[:, None] * way)
        gone = np.minimum(gone + np.maximum(distance, 0) / 0.6, 1.0)
    assert len(start) > 1000
    assert (gone < 0.6).all()
