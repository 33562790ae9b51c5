"""Rays, nearest points and overlaps against linear systems, trimesh and clipped polygons in float64."""

import numpy as np
import pytest
import trimesh

from taichi_soft import OptionError, SpringMaterial, StateError, box, cloth, rope, sphere
from taichi_soft.bodies.status import ABSENT, ACTIVE, FROZEN
from taichi_soft.world.bare import bare_world

NAN, INF = float("nan"), float("inf")
SPRING = SpringMaterial(stiffness=100.0)
BALL, MIRRORED, COLLAPSED, SHEET, CORD, REMOTE, CUBE = range(7)
FAR = np.array([2000.0, -1000.0, 500.0])


@pytest.fixture(scope="module")
def crowd(jelly):
    """Seven bodies of every kind; none of these tests moves one."""
    world = bare_world(floor=None, gravity=(0, 0, 0))
    ball, block, sheet = sphere(0.5, 3), box(cells=(2, 2, 2)), cloth((1.0, 1.0), (4, 4), 1.0)
    line = rope(1.5, 5, 1.0)
    random = np.random.default_rng(4)
    vertices = ball.vertices
    wavy = vertices + 0.1 * np.sin(5 * vertices[:, [1, 2, 0]]) + random.normal(0, 0.01, vertices.shape)
    shapes = (
        (ball, wavy),
        (block, block.vertices * [-1, 1, 1] + [1.5, 0, 0]),
        (block, 0.5 * block.vertices[:, :1] * [1, 1, 0] + [0, 1.5, 0]),
        (sheet, np.add(sheet.vertices, [-2, 0, 0])),
        (line, np.add(line.vertices, [0.75, 0, 2])),
        (ball, wavy + FAR),
        (block, np.add(block.vertices, [0, -2, 0])),
    )
    for mesh, _ in shapes:
        if len(mesh.tets):
            world.add_body(mesh, jelly)
        else:
            world.add_body(mesh, SPRING, law="springs")
    world.build()
    for body, (_, positions) in zip(world.bodies, shapes, strict=True):
        body.set_motion(positions, np.zeros_like(positions))
    return world


@pytest.fixture
def unchanged(crowd):
    """Check that the test leaves positions, velocities and status of all bodies unchanged."""

    def state():
        present = crowd._built.state
        fields = (present.particle_position, present.particle_velocity, present.body_status)
        return [field.to_numpy().tobytes() for field in fields], crowd.step_count

    before = state()
    yield
    assert state() == before


def corners_of(body):
    """Corners of all triangles, (f, 3, 3), in float64."""
    return body.positions().astype(float)[body.surface]


def all_hits(body, origin, direction):
    """Distances, triangles and barycentrics of all crossings: a 3x3 system for each triangle."""
    corners = corners_of(body)
    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    systems = np.stack([ab, ac, np.broadcast_to(-direction, a.shape)], axis=2)
    sound = np.abs(np.linalg.det(systems)) > 1e-12
    if not sound.any():
        return []
    v, w, t = np.linalg.solve(systems[sound], (origin - a[sound])[:, :, None])[:, :, 0].T
    facing = -np.einsum("ij,j->i", np.cross(ab, ac)[sound], direction)
    met = (v >= 0) & (w >= 0) & (v + w <= 1) & (t >= 0)
    rows = zip(t[met], np.flatnonzero(sound)[met], v[met], w[met], facing[met], strict=True)
    return [(body.index, *row) for row in rows]


def first_hit(world, origin, direction, cull_back):
    found = [hit for body in world.bodies for hit in all_hits(body, origin, direction)]
    return min((hit for hit in found if hit[5] > 0 or not cull_back), key=lambda hit: hit[1], default=None)


def random_rays(count):
    """Return random rays from all around towards the centre."""
    random = np.random.default_rng(7)
    origins = random.uniform(-3, 3, (count, 3))
    targets = random.uniform([-2, -2, -0.4], [1.5, 1.5, 0.4], (count, 3))
    origins[::10], targets[::10] = origins[::10] + FAR, targets[::10] * 0.2 + FAR
    directions = targets - origins
    return [rows.astype(np.float32).astype(float) for rows in (origins, directions)]


@pytest.mark.parametrize("cull_back", [True, False])
def test_rays_meet_first_what_linear_systems_meet_first(crowd, unchanged, cull_back):
    origins, directions = random_rays(300)
    hits = crowd.raycasts(origins, directions, cull_back=cull_back)
    met = set()
    for i, (origin, direction) in enumerate(zip(origins, directions, strict=True)):
        expected = first_hit(crowd, origin, direction / np.linalg.norm(direction), cull_back)
        if expected is None:
            assert (hits.body[i], hits.triangle[i], hits.distance[i]) == (-1, -1, INF)
            continue
        body, distance, triangle, v, w, _ = expected
        remote = body == REMOTE
        assert hits.distance[i] == pytest.approx(distance, abs=1e-3 if remote else 3e-6)
        assert hits.body[i] == body
        if min(v, w, 1 - v - w) > 0.01 and (cull_back or body != SHEET):  # each of whose triangles lies twice
            assert hits.triangle[i] == triangle
            np.testing.assert_allclose(hits.barycentrics[i], [1 - v - w, v, w], atol=2e-2 if remote else 1e-4)
            a, b, c = corners_of(crowd.bodies[body])[triangle]
            normal = np.cross(b - a, c - a)
            np.testing.assert_allclose(hits.normal[i], normal / np.linalg.norm(normal), atol=1e-5)
        met.add(body)
    assert met == {BALL, MIRRORED, SHEET, REMOTE, CUBE}
    assert 100 < (hits.body >= 0).sum() < 290


def test_one_ray_finds_what_many_find_to_the_bit(crowd):
    origins, directions = random_rays(60)
    hits = crowd.raycasts(origins, directions)
    for i in range(60):
        hit = crowd.raycast(origins[i], directions[i])
        if hit is None:
            assert hits.body[i] == -1
            continue
        assert (hit.body.index, hit.triangle, hit.distance) == (
            hits.body[i],
            hits.triangle[i],
            hits.distance[i],
        )
        for name in ("point", "normal", "barycentrics"):
            assert getattr(hit, name).tobytes() == getattr(hits, name)[i].tobytes()


def test_a_hit_lies_on_the_ray_and_on_its_triangle(crowd):
    for origin, direction in zip(*random_rays(40), strict=True):
        hit = crowd.raycast(origin, direction)
        if hit is None or hit.body.index == REMOTE:
            continue
        np.testing.assert_array_equal(hit.vertices, hit.body.surface[hit.triangle])
        on_triangle = hit.barycentrics @ hit.body.positions()[hit.vertices]
        np.testing.assert_allclose(hit.point, on_triangle, atol=1e-6)
        on_ray = origin + hit.distance * direction / np.linalg.norm(direction)
        np.testing.assert_allclose(hit.point, on_ray, atol=3e-6)


def test_no_ray_slips_through_between_triangles(crowd):
    """Aimed at every vertex and at points of every edge of a ball, from all sides and from afar."""
    ball = crowd.bodies[BALL]
    corners = corners_of(ball)
    targets = [corners.reshape(-1, 3)]
    targets += [corners * (1 - t) + np.roll(corners, 1, axis=1) * t for t in (0.5, 0.123)]
    points = np.concatenate([rows.reshape(-1, 3) for rows in targets])
    for distance in (2.0, 50.0, 1000.0):
        origins = points / np.linalg.norm(points, axis=1)[:, None] * distance
        hits = crowd.raycasts(origins, points - origins, bodies=[ball])
        assert (hits.body == BALL).all()
        reach = np.linalg.norm(points - origins, axis=1)
        assert (hits.distance <= reach * (1 + 1e-6) + 1e-5).all()


@pytest.mark.parametrize(
    ("origin", "direction", "distance"),
    [
        ((-3, -2.1, 0.2), (1, 0, 0), 2.5),
        ((0, -5, 0.5), (0, 1, 0), 2.5),  # within the top face's plane: onto the edge of the side
        ((0, -5, 0.4999), (0, 1, 0), 2.5),
        ((0, -5, 0.501), (0, 1, 0), None),  # parallel to a face, beside it
        ((3, -2, 3), (-1, 0, -1), 2.5 * 2**0.5),  # onto an edge of the cube
        ((1.5, -0.5, 1.5), (-1, -1, -1), 3**0.5),  # onto its corner
        ((0, -2, 5), (0, 0, -1e-30), 4.5),  # onto a vertex of eight triangles; length does not matter
        ((0, -2, 5), (0, 0, -1e30), 4.5),
        ((0, -2, 5), (0, 0, 1), None),  # away from it
        ((0.1, -2, 0), (1, 0, 0), None),  # from inside
    ],
)
def test_a_cube_is_hit_where_it_should(crowd, origin, direction, distance):
    hit = crowd.raycast(origin, direction, bodies=[crowd.bodies[CUBE]])
    assert (None if hit is None else pytest.approx(hit.distance, abs=1e-5)) == distance


def test_a_ray_from_inside_leaves_unless_back_faces_count(crowd):
    cube = crowd.bodies[CUBE]
    assert crowd.raycast((0.1, -2, 0.05), (1, 0, 0), bodies=[cube]) is None
    hit = crowd.raycast((0.1, -2, 0.05), (1, 0, 0), bodies=[cube], cull_back=False)
    assert hit.distance == pytest.approx(0.4, abs=1e-6)
    np.testing.assert_allclose(hit.normal, [1, 0, 0])


def test_a_sheet_is_hit_from_both_sides(crowd):
    for side in (1, -1):
        hit = crowd.raycast((-2.1, 0.13, side * 3), (0, 0, -side))
        assert hit.body is crowd.bodies[SHEET]
        np.testing.assert_allclose(hit.normal, [0, 0, side])


def test_the_farthest_distance_counts_and_more_does_not(crowd):
    ray = ((0.1, -2.2, 3.5), (0, 0, -1))
    assert crowd.raycast(*ray, max_distance=3.0).distance == 3.0
    assert crowd.raycast(*ray, max_distance=2.999) is None
    assert crowd.raycast(*ray, max_distance=1e-300) is None
    point = (0.1, -2.2, 3.5)
    assert crowd.closest_point(point, bodies=[crowd.bodies[CUBE]], max_distance=3.0).distance == 3.0
    assert crowd.closest_point(point, bodies=[crowd.bodies[CUBE]], max_distance=2.999) is None


def test_only_the_bodies_asked_answer(crowd):
    ray = ((0, -3.5, 0.1), (0, 1, 0))
    assert crowd.raycast(*ray).body is crowd.bodies[CUBE]
    assert crowd.raycast(*ray, bodies=[crowd.bodies[SHEET], crowd.bodies[BALL]]).body is crowd.bodies[BALL]
    assert crowd.raycast(*ray, bodies=[]) is None
    assert crowd.closest_point((0, 0, 0), bodies=()) is None
    assert crowd.closest_point((0, -2, 0), bodies=iter([crowd.bodies[BALL]])).body is crowd.bodies[BALL]


def test_only_the_bodies_asked_overlap(crowd):
    ball, cube = crowd.bodies[BALL], crowd.bodies[CUBE]
    for overlap in (crowd.overlap_sphere((0, 0, 0), 9.0), crowd.overlap_box((0, 0, 0), (18, 18, 18))):
        assert {ball, cube} < {each.body for each in overlap}
    for asked in (
        crowd.overlap_sphere((0, 0, 0), 9.0, bodies=[cube, ball]),
        crowd.overlap_box((0, 0, 0), (18, 18, 18), bodies=iter([ball, cube])),
    ):
        assert [each.body for each in asked] == sorted((ball, cube), key=lambda body: body.index)
        assert [len(each.vertices) for each in asked] == [each.body.vertex_count for each in asked]
    assert crowd.overlap_sphere((0, 0, 0), 9.0, bodies=[]) == ()


def test_a_rope_has_no_surface_but_nearest_vertices(crowd):
    cord = crowd.bodies[CORD]
    x = cord.positions().astype(float)
    assert crowd.raycast(x[2] + [0, 0, 1], (0, 0, -1), cull_back=False, bodies=[cord]) is None
    nearest = crowd.closest_point(x[2] + [0.01, 0, 0.1], bodies=[cord])
    assert (nearest.triangle, nearest.is_inside, nearest.vertices.tolist()) == (None, False, [2, 2, 2])
    np.testing.assert_allclose(nearest.point, x[2], atol=1e-6)
    np.testing.assert_allclose(nearest.normal, np.array([0.01, 0, 0.1]) / np.hypot(0.01, 0.1), atol=1e-5)
    overlap = next(o for o in crowd.overlap_sphere(x[2], 0.4) if o.body is cord)
    assert overlap.vertices.tolist() == np.flatnonzero(np.linalg.norm(x - x[2], axis=1) <= 0.4).tolist()
    between = 0.5 * (x[2] + x[3])
    assert all(o.body is not cord for o in crowd.overlap_sphere(between, 0.01))


def test_a_collapsed_body_is_near_but_cannot_be_hit(crowd):
    flat = crowd.bodies[COLLAPSED]
    x = flat.positions().astype(float)
    assert crowd.raycast((0, 1.5, 2), (0, 0, -1), bodies=[flat], cull_back=False) is None
    middle = x.mean(axis=0)
    nearest = crowd.closest_point(np.add(middle, [0, 0, 0.2]), bodies=[flat])
    assert nearest.distance == pytest.approx(0.2, abs=1e-6)
    np.testing.assert_allclose(nearest.normal, [0, 0, 1], atol=1e-5)
    assert not nearest.is_inside
    at_it = crowd.closest_point(x[0], bodies=[flat])
    assert (at_it.distance, np.isfinite(at_it.normal).all()) == (0.0, True)


def is_in_tets(body, point):
    corners = body.positions().astype(float)[body.tets]
    shapes = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    weights = np.linalg.solve(shapes, (point - corners[:, 0])[:, :, None])[:, :, 0]
    return bool(((weights >= 0).all(axis=1) & (weights.sum(axis=1) <= 1)).any())


def test_nearest_points_are_those_of_trimesh_and_inside_is_within_a_tetrahedron(crowd, unchanged):
    random = np.random.default_rng(3)
    places = {
        BALL: [0, 0, 0],
        MIRRORED: [1.5, 0, 0],
        SHEET: [-2, 0, 0],
        REMOTE: FAR,
        CUBE: [0, -2, 0],
    }
    for index, center in places.items():
        body = crowd.bodies[index]
        surface = trimesh.Trimesh(body.positions().astype(float), body.surface, process=False)
        points = (center + random.uniform(-0.8, 0.8, (40, 3))).astype(np.float32).astype(float)
        _, distances, _ = trimesh.proximity.closest_point_naive(surface, points)
        insides = 0
        for point, distance in zip(points, distances, strict=True):
            nearest = crowd.closest_point(point, bodies=[body])
            precision = 2e-4 if index == REMOTE else 2e-6
            assert nearest.distance == pytest.approx(distance, abs=2e-6)
            on_triangle = nearest.barycentrics @ body.positions().astype(float)[nearest.vertices]
            assert np.linalg.norm(on_triangle - point) == pytest.approx(distance, abs=precision)
            np.testing.assert_allclose(nearest.point, on_triangle, atol=precision)
            np.testing.assert_array_equal(nearest.vertices, body.surface[nearest.triangle])
            a, b, c = corners_of(body)[nearest.triangle]
            normal = np.cross(b - a, c - a)
            np.testing.assert_allclose(nearest.normal, normal / np.linalg.norm(normal), atol=1e-5)
            if len(body.tets) == 0:
                assert not nearest.is_inside
            elif distance > 1e-4:
                assert nearest.is_inside == is_in_tets(body, point)
                insides += nearest.is_inside
        assert insides > 3 or index == SHEET


def test_the_nearest_of_all_bodies_is_found(crowd):
    random = np.random.default_rng(5)
    for point in random.uniform(-2.5, 2.5, (40, 3)).astype(np.float32):
        alone = [crowd.closest_point(point, bodies=[body]) for body in crowd.bodies]
        best = min(alone, key=lambda nearest: nearest.distance)
        nearest = crowd.closest_point(point)
        assert (nearest.body, nearest.triangle, nearest.distance) == (
            best.body,
            best.triangle,
            best.distance,
        )


def places_near(bodies, count, seed):
    """Points within reach of one body each, and sizes."""
    random = np.random.default_rng(seed)
    middles = [body.positions().mean(axis=0) for body in bodies]
    for i in range(count):
        center = middles[i % len(middles)] + random.uniform(-0.8, 0.8, 3)
        yield center.astype(np.float32), random.uniform(0.02, 0.8, 3).astype(np.float32)


def polygon_in_box(corners, half):
    """A triangle clipped by the six planes of a box about the origin (Sutherland and Hodgman)."""
    polygon = list(corners)
    for axis in range(3):
        for side in (1, -1):
            kept = []
            for p, q in zip(polygon, polygon[1:] + polygon[:1], strict=True):
                depth_p, depth_q = half[axis] - side * p[axis], half[axis] - side * q[axis]
                if depth_p >= 0:
                    kept.append(p)
                if depth_p * depth_q < 0:
                    kept.append(p + depth_p / (depth_p - depth_q) * (q - p))
            polygon = kept
    return len(polygon) > 0


def test_overlaps_with_boxes_are_those_of_clipped_triangles(crowd, unchanged, turned):
    count = 0
    for center, size in places_near(crowd.bodies, 84, seed=6):
        rotation = turned.T if size[0] > size[1] else turned
        overlaps = {o.body.index: o.vertices for o in crowd.overlap_box(center, size, rotation)}
        assert list(overlaps) == sorted(overlaps)
        for body in crowd.bodies:
            local = (body.positions().astype(float) - center) @ rotation
            inside = np.flatnonzero((np.abs(local) <= size / 2).all(axis=1))
            touches = len(inside) > 0 or any(polygon_in_box(t, size / 2) for t in local[body.surface])
            touches = touches or (body.index not in (CORD, SHEET, COLLAPSED) and is_in_tets(body, center))
            assert (body.index in overlaps) == touches
            if touches:
                assert overlaps[body.index].tolist() == inside.tolist()
            count += touches
    assert 30 < count < 84


def test_overlaps_with_spheres_are_those_of_distances(crowd, unchanged):
    count = 0
    bodies = [body for body in crowd.bodies if body.index not in (CORD, COLLAPSED)]
    for center, size in places_near(bodies, 80, seed=8):
        radius = 0.7 * float(size[0])
        overlaps = {o.body.index: o.vertices for o in crowd.overlap_sphere(center, radius)}
        for body in bodies:
            x = body.positions().astype(float)
            surface = trimesh.Trimesh(x, body.surface, process=False)
            near = trimesh.proximity.closest_point_naive(surface, center[None])[1][0] <= radius
            touches = bool(near) or (body.index != SHEET and is_in_tets(body, center.astype(float)))
            assert (body.index in overlaps) == touches
            if touches:
                inside = np.flatnonzero(np.linalg.norm(x - center, axis=1) <= radius)
                assert overlaps[body.index].tolist() == inside.tolist()
            count += touches
    assert 30 < count < 80


def test_a_shape_within_a_body_touches_it_and_a_body_within_a_shape_is_whole(crowd):
    (overlap,) = crowd.overlap_sphere((0.2, -2.2, 0.2), 0.05)
    assert (overlap.body.index, overlap.vertices.tolist()) == (CUBE, [])
    (overlap,) = crowd.overlap_box((0.2, -2.2, 0.2), (0.05, 0.1, 0.02), (0, 0, 1, 0))
    assert (overlap.body.index, overlap.vertices.tolist()) == (CUBE, [])
    assert [len(o.vertices) for o in crowd.overlap_sphere((0, 0, 0), 20)] == [
        body.vertex_count for body in crowd.bodies if body.index != REMOTE
    ]
    assert crowd.overlap_box((0, 0, 100), (1, 1, 1)) == ()
    along = [o.body.index for o in crowd.overlap_box((0, 1.5, 0), (0.01, 0.01, 0.01))]
    assert along == [COLLAPSED]
    assert [o.body.index for o in crowd.overlap_sphere((0, 1.5, 0), 0.01)] == [COLLAPSED]


def test_frozen_bodies_answer_and_absent_ones_do_not(crowd):
    ray, point = ((0, -2, 5), (0, 0, -1)), (0, -2, 0.45)
    status = crowd._built.state.body_status
    try:
        status[CUBE] = FROZEN
        assert crowd.raycast(*ray).body.index == CUBE
        assert crowd.closest_point(point).body.index == CUBE
        assert [o.body.index for o in crowd.overlap_sphere(point, 0.1)] == [CUBE]
        status[CUBE] = ABSENT
        assert crowd.raycast(*ray) is None
        assert crowd.closest_point(point).body.index != CUBE
        assert crowd.overlap_sphere(point, 0.1) == ()
        assert crowd.overlap_box(point, (0.1, 0.1, 0.1)) == ()
    finally:
        status[CUBE] = ACTIVE


def test_of_equally_near_bodies_the_first_answers(jelly):
    world = bare_world(floor=None)
    mesh = box(cells=(1, 1, 1))
    for _ in range(3):
        world.add_body(mesh, jelly)
    world.build()
    first, second, third = world.bodies
    ray = ((0.1, 0.2, 3), (0, 0, -1))
    assert world.raycast(*ray).body is first
    assert world.raycast(*ray, bodies=[third, second, third]).body is second
    assert world.closest_point((0, 0, 3)).body is first
    diagonal = world.raycast((0, 0, 3), (0, 0, -1))  # onto the edge between two triangles
    assert diagonal.triangle == world.raycast((0, 0, 3), (0, 0, -1)).triangle
    assert diagonal.normal.tolist() == [0, 0, 1]


def test_no_rays_hit_nothing(crowd):
    hits = crowd.raycasts(np.zeros((0, 3)), np.zeros((0, 3)))
    assert [len(rows) for rows in vars(hits).values()] == [0] * 7
    hits = crowd.raycasts([[0, 0, 9]], [[0, 0, 1]])
    assert (hits.body.tolist(), hits.triangle.tolist(), hits.distance.tolist()) == ([-1], [-1], [INF])
    assert np.isnan(hits.point).all()


UP = (0, 0, 1)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda w: w.raycast((0, 0, NAN), UP), "origin must be finite"),
        (lambda w: w.raycast((0, 0), UP), "origin must have shape"),
        (lambda w: w.raycast((0, 0, 1e9), UP), "origin must lie within"),
        (lambda w: w.raycast((0, 0, 0), (0, 0, 0)), "direction has zero length"),
        (lambda w: w.raycast((0, 0, 0), (0, INF, 0)), "direction must be finite"),
        (lambda w: w.raycast((0, 0, 0), "up"), "direction must be numbers"),
        (lambda w: w.raycast((0, 0, 0), UP, max_distance=0), "max_distance must be"),
        (lambda w: w.raycast((0, 0, 0), UP, max_distance=-1.0), "max_distance must be"),
        (lambda w: w.raycast((0, 0, 0), UP, max_distance=NAN), "max_distance must be"),
        (lambda w: w.raycast((0, 0, 0), UP, max_distance=-INF), "max_distance must be"),
        (lambda w: w.raycast((0, 0, 0), UP, max_distance=None), "max_distance must be"),
        (lambda w: w.raycast((0, 0, 0), UP, cull_back=None), "cull_back must be"),
        (lambda w: w.raycast((0, 0, 0), UP, bodies=w.bodies[0]), "bodies must be a list"),
        (lambda w: w.raycast((0, 0, 0), UP, bodies=[0]), "bodies must be a list"),
        (lambda w: w.raycast((0, 0, 0), UP, bodies="all"), "bodies must be a list"),
        (lambda w: w.raycasts([[0, 0, 0]], [UP, UP]), "directions must have shape"),
        (lambda w: w.raycasts([[0, 0, 0]] * 2, [UP, (0, 0, 0)]), "directions 1 has zero length"),
        (lambda w: w.raycasts([[0, 0, 1e8]], [UP]), "origins must lie within"),
        (lambda w: w.closest_point((0, NAN, 0)), "point must be finite"),
        (lambda w: w.closest_point((0, 0, 0), max_distance=0.0), "max_distance must be"),
        (lambda w: w.overlap_sphere((0, 0, 0), 0), "radius must be"),
        (lambda w: w.overlap_sphere((0, 0, 0), INF), "radius must be"),
        (lambda w: w.overlap_sphere((0, 0, 0), True), "radius must be"),
        (lambda w: w.overlap_sphere(None, 1.0), "center must be"),
        (lambda w: w.overlap_box((0, 0, 0), (1, 0, 1)), "size.*above 0"),
        (lambda w: w.overlap_box((0, 0, 0), (1, -1, 1)), "size.*above 0"),
        (lambda w: w.overlap_box((0, 0, 0), 1.0), "size must have shape"),
        (lambda w: w.overlap_box((0, 0, 0), (1, 1, 1), (0, 0, 0, 2)), "normalise it"),
        (lambda w: w.overlap_box((0, 0, 0), (1, 1, 1), np.eye(3) * -1), "determinant"),
    ],
)
def test_questions_without_sense_are_refused(crowd, unchanged, call, message):
    with pytest.raises(OptionError, match=message):
        call(crowd)


def test_bodies_of_another_world_and_worlds_not_built_are_refused(crowd, jelly):
    other = bare_world(floor=None)
    stranger = other.add_body(box(cells=(1, 1, 1)), jelly)
    with pytest.raises(OptionError, match="this world's bodies"):
        crowd.raycast((0, 0, 0), UP, bodies=[stranger])
    with pytest.raises(OptionError, match="this world's bodies"):
        crowd.overlap_sphere((0, 0, 0), 1.0, bodies=[stranger])
    with pytest.raises(OptionError, match="this world's bodies"):
        crowd.overlap_box((0, 0, 0), (1, 1, 1), bodies=[stranger])
    for call in (
        lambda: other.raycast((0, 0, 0), UP),
        lambda: other.raycasts([(0, 0, 0)], [UP]),
        lambda: other.closest_point((0, 0, 0)),
        lambda: other.overlap_sphere((0, 0, 0), 1.0),
        lambda: other.overlap_box((0, 0, 0), (1, 1, 1)),
        stranger.aabb,
        stranger.pose,
        stranger.vertex_strain,
        stranger.flipped_tets,
    ):
        with pytest.raises(StateError, match="build"):
            call()


def test_answers_follow_the_motion(jelly):
    world = bare_world(floor=None, gravity=(0, 0, -10))
    world.add_body(box(cells=(1, 1, 1)), jelly)
    world.build()
    start = world.raycast((0.1, 0.2, 3), (0, 0, -1)).distance
    for _ in range(30):
        world.step(1 / 60, 4)
    fallen = world.raycast((0.1, 0.2, 3), (0, 0, -1))
    assert fallen.distance - start == pytest.approx(0.5 * 10 * 0.25, rel=1e-3)
    assert world.closest_point((0.1, 0.2, 3)).distance == pytest.approx(fallen.distance, abs=1e-5)
