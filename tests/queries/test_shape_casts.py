"""Casts of spheres, capsules and boxes: distances against dense sampling and convex hulls in float64."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from taichi_soft import (
    BoxShape,
    CapsuleShape,
    HeightFieldShape,
    OptionError,
    PlaneShape,
    SphereShape,
    SpringMaterial,
    StateError,
    World,
    box,
    rope,
    sphere,
)
from taichi_soft.world.bare import bare_world

INF = float("inf")
DOWN = (0.0, 0.0, -1.0)
BALL, CUBE = range(2)
FLOOR, STONE, BLOCK, POST, GROUND = range(5)
TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
SHAPES = (SphereShape(0.3), CapsuleShape(0.2, 0.7), BoxShape((0.5, 0.3, 0.8)))


@pytest.fixture(scope="module")
def scene(jelly):
    """Two bodies, a deformed one and one at rest, and five colliders far apart."""
    world = bare_world(floor=None, gravity=(0, 0, 0))
    ball = sphere(0.6, 3)
    x = ball.vertices
    world.add_body(ball, jelly)
    world.add_body(box(cells=(2, 2, 2)), jelly, position=(0, 4, 0))
    heights = np.random.default_rng(2).uniform(-0.4, 0.4, (9, 9))
    world.add_collider(PlaneShape(), position=(0, 0, -4))
    world.add_collider(SphereShape(0.5), position=(4, 0, 0))
    world.add_collider(BoxShape((1.0, 0.6, 0.8)), position=(4, 4, 0), rotation=TURN)
    world.add_collider(CapsuleShape(0.3, 1.0), position=(8, 0, 0), rotation=TURN.T)
    world.add_collider(HeightFieldShape(heights, 0.4), position=(8, 4, 0))
    world.build()
    world.bodies[BALL].set_motion(x + 0.08 * np.sin(5 * x[:, [1, 2, 0]]), np.zeros_like(x))
    return world


def core_of(shape, turn):
    """Return points of a shape's core, all corners of a box or dense points of a segment, and the radius."""
    if isinstance(shape, SphereShape):
        return np.zeros((1, 3)), shape.radius
    if isinstance(shape, CapsuleShape):
        s = np.linspace(-0.5, 0.5, 201)[:, None] * shape.length
        return s * turn[:, 2], shape.radius
    corners = np.array([[(k >> i & 1) - 0.5 for i in range(3)] for k in range(8)]) * shape.size
    return corners @ turn.T, 0.0


def gap_to_triangles(points, triangles):
    """Smallest distance between points and triangles: projections onto planes and edges."""
    best = INF
    for a, b, c in triangles:
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal)
        height = (points - a) @ normal
        foot = points - height[:, None] * normal
        inside = np.all(
            [np.cross(q - p, foot - p) @ normal >= 0 for p, q in ((a, b), (b, c), (c, a))], axis=0
        )
        if inside.any():
            best = min(best, np.abs(height[inside]).min())
        for p, q in ((a, b), (b, c), (c, a)):
            t = np.clip((points - p) @ (q - p) / ((q - p) @ (q - p)), 0, 1)
            best = min(best, np.linalg.norm(points - p - t[:, None] * (q - p), axis=1).min())
    return best


def first_root(gap, limit, count=120):
    """First t at which a function becomes negative: sampled, then bisected."""
    grid = np.linspace(0.0, limit, count)
    low = 0.0
    for t in grid[1:]:
        if gap(t) < 0:
            high = t
            for _ in range(20):
                middle = 0.5 * (low + high)
                low, high = (low, middle) if gap(middle) < 0 else (middle, high)
            return low
        low = t
    return INF


def box_on_triangles(shape, turn, start, d, triangles):
    """Distance at which a box touches triangles: a ray against the hull of each Minkowski difference."""
    corners, _ = core_of(shape, turn)
    best = INF
    for triangle in triangles:
        hull = ConvexHull((triangle[:, None] - corners[None]).reshape(-1, 3))
        along, at = hull.equations[:, :3] @ d, hull.equations[:, :3] @ start + hull.equations[:, 3]
        with np.errstate(divide="ignore"):
            t = -at / along
        enter, leave = t[along < -1e-12].max(initial=-INF), t[along > 1e-12].min(initial=INF)
        if enter <= leave and enter >= 0 and (at[np.abs(along) <= 1e-12] <= 0).all():
            best = min(best, enter)
    return best


def expected_distance(shape, turn, start, d, triangles, limit):
    if isinstance(shape, BoxShape):
        return box_on_triangles(shape, turn, start, d, triangles)
    points, radius = core_of(shape, turn)
    reach = np.abs(points).max() + radius
    middles = triangles.mean(axis=1) - start
    beside = np.linalg.norm(middles - (middles @ d)[:, None] * d, axis=1)
    size = np.linalg.norm(triangles - triangles.mean(axis=1, keepdims=True), axis=2).max(axis=1)
    near = triangles[beside <= reach + size]
    return first_root(lambda t: gap_to_triangles(points + start + t * d, near) - radius, limit, 50)


def triangles_of(world, target):
    if hasattr(target, "surface"):
        return target.positions().astype(float)[target.surface]
    vertices, triangles = target.shape.surface()
    return (vertices @ target.rotation.T + target.position)[triangles]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
@pytest.mark.parametrize("name", ["ball", "cube", "block", "ground"])
def test_shapes_touch_triangles_where_sampling_and_hulls_say(scene, shape, name):
    targets = {"ball": scene.bodies[BALL], "cube": scene.bodies[CUBE]}
    targets |= {"block": scene.colliders[BLOCK], "ground": scene.colliders[GROUND]}
    target = targets[name]
    triangles = triangles_of(scene, target)
    center = triangles.reshape(-1, 3).mean(axis=0)
    random = np.random.default_rng(4)
    hits = 0
    for _ in range(8):
        turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        start = center + random.uniform([-1.5, -1.5, 1.8], [1.5, 1.5, 2.4])
        d = center + random.uniform(-0.8, 0.8, 3) - start
        d /= np.linalg.norm(d)
        expected = expected_distance(shape, turn, start, d, triangles, 4.0)
        chosen = (
            {"bodies": [target], "colliders": False}
            if name in ("ball", "cube")
            else {"bodies": [], "colliders": [target]}
        )
        hit = scene.shapecast(shape, start, d, rotation=turn, max_distance=4.0, **chosen)
        assert (hit is None) == np.isinf(expected)
        if hit is None:
            continue
        hits += 1
        # Dense points of a segment lie up to 2 mm from its nearest point, which is then up to 8 um too far.
        assert hit.distance == pytest.approx(expected, abs=2e-5 / max(abs(hit.normal @ d), 0.05))
        assert hit.normal @ d < 0
        assert (hit.body or hit.collider) is target
        assert gap_to_triangles(hit.point[None], triangles) < 1e-5
        # The surface of the moved shape has its support in the direction of the normal at the point.
        points, radius = core_of(shape, turn)
        lowest = ((points + start + hit.distance * d) @ hit.normal).min() - radius
        assert lowest == pytest.approx(hit.point @ hit.normal, abs=1e-4)
        if name in ("ball", "cube"):
            on = hit.barycentrics @ target.positions().astype(float)[target.surface[hit.triangle]]
            np.testing.assert_allclose(hit.point, on, atol=1e-5)
    assert hits >= 4


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_shapes_touch_planes_spheres_and_capsules_at_closed_forms(scene, shape):
    random = np.random.default_rng(6)
    for _ in range(20):
        turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        points, radius = core_of(shape, turn)
        start = np.array([0.0, -6.0, random.uniform(-1, 3)])
        hit = scene.shapecast(shape, start, DOWN, rotation=turn, colliders=[scene.colliders[FLOOR]])
        lowest = points[:, 2].min() - radius
        assert hit.distance == pytest.approx(start[2] + lowest + 4.0, abs=2e-6)
        np.testing.assert_allclose(hit.normal, (0, 0, 1), atol=1e-6)
        for index, extra in ((STONE, 0.5), (POST, 0.3)):
            target = scene.colliders[index]
            axis = TURN.T[:, 2] * (0.5 if index == POST else 0.0)
            dense = points
            if isinstance(shape, BoxShape):
                grid = np.stack(np.meshgrid(*[np.linspace(-0.5, 0.5, 33)] * 3), axis=-1).reshape(-1, 3)
                dense = grid[np.abs(grid).max(axis=1) == 0.5] * shape.size @ turn.T
            start = target.position + random.uniform([-0.5, -0.5, 2], [0.5, 0.5, 3])

            def gap(t, dense=dense, start=start, target=target, axis=axis, extra=extra + radius):
                x = dense + start + t * np.array(DOWN) - target.position
                s = np.clip(x @ axis / max(axis @ axis, 1e-30), -1, 1)
                return np.linalg.norm(x - s[:, None] * axis, axis=1).min() - extra

            expected = first_root(gap, 4.0, 40)
            hit = scene.shapecast(
                shape, start, DOWN, rotation=turn, max_distance=4.0, bodies=[], colliders=[target]
            )
            if hit is None or np.isinf(expected):
                assert hit is None
                assert np.isinf(expected)
                continue
            # The grid on a box is 25 mm wide, so that its nearest point is up to 1 mm too far.
            coarse = 2e-3 if isinstance(shape, BoxShape) else 1e-5
            assert -1e-5 <= expected - hit.distance <= coarse / abs(hit.normal[2])
            assert hit.collider is target


def test_an_overlap_at_the_start_reports_its_depth_if_the_motion_leads_deeper(scene):
    floor = scene.colliders[FLOOR]
    for shape, low in ((SHAPES[0], 0.3), (SHAPES[1], 0.55), (SHAPES[2], 0.4)):
        start = (0, -6, -4 + low - 0.05)
        hit = scene.shapecast(shape, start, DOWN, colliders=[floor])
        assert (hit.distance, hit.depth) == (0.0, pytest.approx(0.05, abs=1e-6))
        for leaves in ((0, 0, 1), (1, 0, 0)):
            assert scene.shapecast(shape, start, leaves, bodies=[], colliders=[floor]) is None
    for shape, low in ((SHAPES[0], 0.3), (SHAPES[1], 0.55), (SHAPES[2], 0.4)):
        start = (0, 4, 0.5 + low - 0.05)  # above the cube's upper side
        hit = scene.shapecast(shape, start, DOWN, colliders=False)
        assert (hit.body.index, hit.distance, hit.depth) == (CUBE, 0.0, pytest.approx(0.05, abs=1e-5))
        np.testing.assert_allclose(hit.normal, (0, 0, 1), atol=1e-4)
        assert scene.shapecast(shape, start, (0, 0, 1), colliders=False) is None


def test_a_shape_inside_a_body_or_collider_can_only_leave(scene):
    small = SphereShape(0.05)
    deep = scene.shapecast(small, (0, 4, 0.4), DOWN, colliders=False)
    assert (deep.body.index, deep.distance, deep.depth) == (CUBE, 0.0, pytest.approx(0.15, abs=1e-5))
    assert scene.shapecast(small, (0, 4, 0.4), (0, 0, 1), colliders=False) is None
    center = scene.colliders[STONE].position
    above = np.add(center, (0, 0, 0.4))
    deep = scene.shapecast(small, above, DOWN, bodies=[])
    assert (deep.collider.index, deep.depth) == (STONE, pytest.approx(0.15, abs=1e-5))
    assert scene.shapecast(small, above, (0, 0, 1), bodies=[]) is None
    inside = scene.colliders[BLOCK].position + 0.3 * TURN[:, 2]
    deep = scene.shapecast(small, inside, -TURN[:, 2], bodies=[])
    assert (deep.collider.index, deep.depth) == (BLOCK, pytest.approx(0.15, abs=1e-5))
    assert scene.shapecast(small, inside, TURN[:, 2], bodies=[]) is None


def test_the_first_of_bodies_and_colliders_is_touched(scene):
    hit = scene.shapecast(SphereShape(0.1), (0, 4, 5), DOWN)
    assert (hit.body.index, hit.collider) == (CUBE, None)
    hit = scene.shapecast(SphereShape(0.1), (0, 4, 5), DOWN, bodies=[])
    assert (hit.body, hit.collider.index) == (None, FLOOR)
    assert scene.shapecast(SphereShape(0.1), (0, 4, 5), DOWN, max_distance=4.0) is None
    near = scene.shapecast(SphereShape(0.1), (0, 4, 5), DOWN, max_distance=4.41)
    assert near.distance == pytest.approx(4.4, abs=1e-6)


def test_a_sphere_without_size_touches_where_a_ray_hits(scene):
    random = np.random.default_rng(9)
    for _ in range(40):
        start = random.uniform([-1, -1, 2], [9, 5, 4])
        d = random.uniform([-1, -1, -3], [1, 1, -1])
        ray = scene.raycast(start, d, colliders=True)
        cast = scene.shapecast(SphereShape(1e-6), start, d)
        assert (ray.body, ray.collider) == (cast.body, cast.collider)
        assert cast.distance == pytest.approx(ray.distance, abs=2e-5)


def test_a_rope_is_touched_at_its_vertices():
    world = bare_world(floor=None)
    cord = world.add_body(rope(1.0, 4, 1.0), SpringMaterial(stiffness=100.0), law="springs")
    world.build()
    x = cord.positions().astype(float)
    hit = world.shapecast(SphereShape(0.1), x[2] + [0, 0, 1], DOWN)
    assert (hit.body, hit.triangle, hit.vertices.tolist()) == (cord, -1, [2, 2, 2])
    assert hit.distance == pytest.approx(0.9, abs=1e-6)


def test_bad_casts_are_refused(scene, jelly):
    for shape in (PlaneShape(), 0.3, None):
        with pytest.raises(OptionError, match="shape must be a SphereShape, a CapsuleShape or a BoxShape"):
            scene.shapecast(shape, (0, 0, 5), DOWN)
    with pytest.raises(OptionError, match="direction has zero length"):
        scene.shapecast(SHAPES[0], (0, 0, 5), (0, 0, 0))
    with pytest.raises(OptionError, match="position"):
        scene.shapecast(SHAPES[0], (0, 0, float("nan")), DOWN)
    with pytest.raises(OptionError, match="max_distance"):
        scene.shapecast(SHAPES[0], (0, 0, 5), DOWN, max_distance=0)
    with pytest.raises(OptionError, match="rotation"):
        scene.shapecast(SHAPES[0], (0, 0, 5), DOWN, rotation=(1, 2))
    with pytest.raises(StateError, match="build"):
        World().shapecast(SHAPES[0], (0, 0, 5), DOWN)
