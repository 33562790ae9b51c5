"""Which sample sees which triangle, against geometry computed here."""

import numpy as np
import pytest

from taichi_soft import init
from taichi_soft.render import Camera
from taichi_soft.render.frame_arrays import SceneArrays
from taichi_soft.render.raster import ROTATED_GRID, Raster
from taichi_soft.render.texture import SceneTextures

WIDTH, HEIGHT = 200, 140
CAMERA = Camera((0.0, -4.0, 0.0))  # looks along +y; x to the right, z up


@pytest.fixture(scope="module", autouse=True)
def _taichi():
    init("cpu")


def scene(*triangles):
    """Triangles given by their corners, each with vertices of its own."""
    positions = np.array(triangles, dtype=np.float32).reshape(-1, 3)
    corners = np.arange(len(positions), dtype=np.int32).reshape(-1, 3)
    nothing = np.zeros_like(positions)
    plain = SceneTextures.of([None], [None], [len(positions)], [len(corners)])
    return SceneArrays(positions, nothing, nothing, corners, np.zeros(len(corners), dtype=np.int32), plain)


def draw(parts, camera=CAMERA, width=WIDTH, height=HEIGHT):
    raster = Raster(width, height, ROTATED_GRID)
    raster.draw(parts, np.vstack([camera.matrix(width, height), [0, 0, 0, 1]]), camera.near)
    shape = (height, width, len(ROTATED_GRID))
    return raster.owner.reshape(shape), raster.depth.reshape(shape)


def polygon_area(points):
    x, y = np.asarray(points)[:, 0], np.asarray(points)[:, 1]
    return 0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def facing(x, z, size, y=0.0):
    """A right-angled triangle that faces the camera (towards -y)."""
    return [(x, y, z), (x + size, y, z), (x, y, z + size)]


def test_covered_area_is_the_triangles():
    rng = np.random.default_rng(2)
    for _ in range(20):
        corners = rng.uniform(-0.9, 0.9, (3, 3))
        if np.cross(corners[1] - corners[0], corners[2] - corners[0]) @ (corners[0] - CAMERA.eye) > 0:
            corners = corners[::-1]
        pixels = CAMERA.project(corners, WIDTH, HEIGHT)[:, :2]
        if not ((pixels > 0) & (pixels < (WIDTH, HEIGHT))).all():
            continue
        owner, _ = draw(scene(corners))
        perimeter = np.linalg.norm(pixels - np.roll(pixels, 1, axis=0), axis=1).sum()
        assert (owner == 0).sum() / 4 == pytest.approx(polygon_area(pixels), abs=0.05 * perimeter + 1.0)


def test_depth_is_one_over_the_distance_along_the_line_of_sight():
    corners = np.array([(-1.0, -1.0, -1.0), (1.5, 1.0, -1.0), (-0.5, 2.0, 1.5)])
    owner, depth = draw(scene(corners))
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    rows, columns, samples = np.nonzero(owner == 0)
    assert len(rows) > 1000
    focal = HEIGHT / 2 / np.tan(np.radians(20.0))
    x = (columns + 0.5 + ROTATED_GRID[samples, 0] - WIDTH / 2) / focal
    z = -(rows + 0.5 + ROTATED_GRID[samples, 1] - HEIGHT / 2) / focal
    rays = np.stack([x, np.ones_like(x), z], axis=1)
    distance = (corners[0] - CAMERA.eye) @ normal / (rays @ normal)
    np.testing.assert_allclose(depth[rows, columns, samples], 1.0 / distance, rtol=2e-5)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_nearer_triangle_hides_the_farther(order):
    near, far = facing(-0.5, -0.5, 1.0, y=-0.5), facing(-0.6, -0.6, 1.4, y=0.5)
    both = [near, far]
    owner, _ = draw(scene(*(both[i] for i in order)))
    alone, _ = draw(scene(near))
    assert (owner[alone == 0] == order.index(0)).all()
    assert (owner == order.index(1)).any()


def test_triangles_that_pierce_each_other_meet_where_they_cross():
    left = [(-1.0, -1.0, -1.0), (1.0, 1.0, -1.0), (0.0, 0.0, 1.5)]
    right = [(-1.0, 1.0, -1.0), (1.0, -1.0, -1.0), (0.0, 0.0, 1.5)]
    owner, _ = draw(scene(left, right))
    columns = np.arange(WIDTH)[None, :, None] + np.zeros(owner.shape)
    assert (owner[(columns < WIDTH / 2 - 1) & (owner >= 0)] == 0).all()
    assert (owner[(columns > WIDTH / 2) & (owner >= 0)] == 1).all()


def test_only_the_outside_is_seen():
    assert (draw(scene(facing(-0.5, -0.5, 1.0)))[0] == 0).any()
    assert (draw(scene(facing(-0.5, -0.5, 1.0)[::-1]))[0] == -1).all()


def test_neighbours_leave_no_seam():
    rng = np.random.default_rng(8)
    grid = np.linspace(-1.2, 1.2, 14)
    x, z = np.meshgrid(grid, grid)
    step = grid[1] - grid[0]
    inner = (np.abs(x) < 1.19) & (np.abs(z) < 1.19)
    x, z = (
        x + 0.3 * step * rng.uniform(-1, 1, x.shape) * inner,
        z + 0.3 * step * rng.uniform(-1, 1, x.shape) * inner,
    )
    points = np.stack([x, 0.1 * rng.uniform(-1, 1, x.shape) * inner, z], axis=-1)
    triangles = []
    for i in range(13):
        for j in range(13):
            a, b, c, d = points[i, j], points[i, j + 1], points[i + 1, j + 1], points[i + 1, j]
            triangles += [(a, b, c), (a, c, d)]
    owner, _ = draw(scene(*triangles))
    square = CAMERA.project([(-1.19, 0, -1.19), (1.19, 0, 1.19)], WIDTH, HEIGHT)
    left, right = np.ceil(square[:, 0].min()), np.floor(square[:, 0].max())
    top, bottom = np.ceil(square[:, 1].min()), np.floor(square[:, 1].max())
    inside = owner[max(int(top), 0) : int(bottom), int(left) : int(right)]
    assert inside.size > 10000
    assert (inside >= 0).all()


def test_a_triangle_through_the_near_plane_is_cut_there():
    # A strip of floor that starts behind the camera: below the horizon it fills its columns.
    camera = Camera((0.0, 0.0, 1.0), (0.0, 10.0, 1.0))
    strip = [(-2.0, -50.0, 0.0), (2.0, -50.0, 0.0), (0.0, 400.0, 0.0)]
    owner, _ = draw(scene(strip), camera)
    assert (owner[-1, WIDTH // 2 - 20 : WIDTH // 2 + 20] == 0).all()
    assert (owner[: HEIGHT // 2] == -1).all()
    # Analytically, at the bottom row: z = 0 is at depth 1 / tangent, where the strip is so wide.
    tangent = np.tan(np.radians(20.0)) * (HEIGHT - 1) / HEIGHT
    depth = 1.0 / tangent
    half = 2.0 * (400.0 - depth) / 450.0 / depth / np.tan(np.radians(20.0)) * HEIGHT / 2
    assert (owner[-1] == 0).mean() * WIDTH == pytest.approx(min(2 * half, WIDTH), abs=2.0)


def test_what_lies_behind_or_outside_is_not_seen():
    behind = facing(-0.5, -0.5, 1.0, y=-8.0)
    beside = facing(500.0, 0.0, 1.0)
    flat = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0)]
    point = [(0.0, 0.0, 0.0)] * 3
    assert (draw(scene(behind, behind[::-1], beside, flat, point))[0] == -1).all()


def test_a_surface_round_the_camera_does_not_crash():
    rng = np.random.default_rng(3)
    triangles = rng.normal(size=(300, 3, 3)) * 3.0 + CAMERA.eye
    owner, depth = draw(scene(*triangles))
    assert (owner >= 0).any()
    assert np.isfinite(depth).all()
    assert depth[owner >= 0].max() <= 1.0 / CAMERA.near * 1.01
