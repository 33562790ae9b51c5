"""Rays, nearest points and shape casts on colliders against closed forms and triangles in float64."""

import numpy as np
import pytest
import trimesh

from taichi_soft import (
    BoxShape,
    CapsuleShape,
    Contact,
    FixedStep,
    HeightFieldShape,
    MeshShape,
    OptionError,
    PlaneShape,
    SphereShape,
    StateError,
    World,
    box,
)
from taichi_soft.world.bare import bare_world

INF = float("inf")
DOWN = (0.0, 0.0, -1.0)
PLANE, SPHERE, BOX, CAPSULE, GROUND, MESH = range(6)
PLACES = np.array([[0, 0, -3.0], [0, 0, 0], [4, 0, 0], [8, 0, 0], [0, 8, 0], [8, 8, 0]])


def rotation_about(axis, angle):
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


TURNS = [rotation_about((1, 2, 3), 0.2 * i) for i in (0, 1, 4, 7, 0, 9)]


@pytest.fixture(scope="module")
def level(jelly):
    """One collider of each shape, turned, and one body."""
    world = bare_world(floor=None, gravity=(0, 0, 0))
    world.add_body(box(cells=(2, 2, 2)), jelly, position=(4, 8, 0))
    heights = np.random.default_rng(2).uniform(-0.5, 0.5, (9, 7))
    shapes = (
        PlaneShape(),
        SphereShape(0.8),
        BoxShape((1.0, 2.0, 0.6)),
        CapsuleShape(0.4, 1.2),
        HeightFieldShape(heights, 0.5),
        MeshShape(trimesh.creation.box((1.5, 1.0, 1.0)), cell=0.05),
    )
    for shape, place, turn in zip(shapes, PLACES, TURNS, strict=True):
        world.add_collider(shape, position=place, rotation=turn)
    world.build()
    return world


def surface_of(collider):
    """Corners of the triangles of a collider, (n, 3, 3)."""
    vertices, triangles = collider.shape.surface()
    return (vertices @ collider.rotation.T + collider.position)[triangles]


def ray_on_triangles(corners, origin, d):
    """Distance and normal of the first front face that a ray hits: a 3x3 system for each triangle."""
    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    systems = np.stack([ab, ac, np.broadcast_to(-d, a.shape)], axis=2)
    keep = np.abs(np.linalg.det(systems)) > 1e-12
    if not keep.any():
        return INF, None
    v, w, t = np.linalg.solve(systems[keep], (origin - a[keep])[:, :, None])[:, :, 0].T
    normals = np.cross(ab, ac)[keep]
    good = (v >= -1e-9) & (w >= -1e-9) & (v + w <= 1 + 1e-9) & (t >= 0) & (normals @ d < 0)
    if not good.any():
        return INF, None
    first = np.flatnonzero(good)[t[good].argmin()]
    return t[first], normals[first] / np.linalg.norm(normals[first])


def ray_on_ball(center, radius, origin, d):
    """Distance of the first root of |origin + t d - center| = radius."""
    b, c = d @ (origin - center), (origin - center) @ (origin - center) - radius**2
    root = b * b - c
    t = -b - np.sqrt(root) if root > 0 else INF
    return t if t >= 0 else INF


def ray_on_capsule(collider, origin, d):
    radius, half = collider.shape.radius, 0.5 * collider.shape.length
    axis = collider.rotation[:, 2]
    found = [ray_on_ball(collider.position + s * half * axis, radius, origin, d) for s in (-1, 1)]
    x = origin - collider.position
    across_d, across_x = d - (d @ axis) * axis, x - (x @ axis) * axis
    a, b, c = across_d @ across_d, across_d @ across_x, across_x @ across_x - radius**2
    if b * b > a * c:
        t = (-b - np.sqrt(b * b - a * c)) / a
        if t >= 0 and abs((x + t * d) @ axis) <= half:
            found.append(t)
    return min(found)


def ray_on(collider, kind, origin, d):
    """Return the distance of the first hit, in closed form."""
    if kind == PLANE:
        n = collider.rotation[:, 2]
        t = (collider.position - origin) @ n / (d @ n)
        return t if t >= 0 and d @ n < 0 else INF
    if kind == SPHERE:
        return ray_on_ball(collider.position, collider.shape.radius, origin, d)
    if kind == CAPSULE:
        return ray_on_capsule(collider, origin, d)
    return ray_on_triangles(surface_of(collider), origin, d)[0]


@pytest.mark.parametrize("kind", range(6))
def test_rays_hit_each_shape_where_the_closed_form_says(level, kind):
    collider = level.colliders[kind]
    random = np.random.default_rng(kind)
    low = 3.0 if kind == GROUND else -3.0
    hits = 0
    for _ in range(150):
        origin = PLACES[kind] + random.uniform([-3, -3, low], [3, 3, 4])
        d = PLACES[kind] + random.uniform(-0.6, 0.6, 3) - origin
        if kind == PLANE:
            origin[2] = PLACES[kind][2] + random.uniform(0.1, 5)
        d /= np.linalg.norm(d)
        expected = ray_on(collider, kind, origin, d)
        hit = level.raycast(origin, d, bodies=[], colliders=[collider])
        if kind == MESH and not np.isinf(expected) and hit is None:
            continue  # past a rounded edge
        assert (hit is None) == np.isinf(expected)
        if hit is None:
            continue
        hits += 1
        # Edges of meshes are rounded by a fraction of a cell. Float32 resolves 0.5 um at this distance.
        precision = (0.05 if kind == MESH else 3e-6) / abs(hit.normal @ d)
        assert hit.distance == pytest.approx(expected, abs=precision)
        np.testing.assert_allclose(hit.point, origin + hit.distance * d, atol=2e-5)
        assert (hit.body, hit.collider, hit.triangle) == (None, collider, -1)
        assert np.linalg.norm(hit.normal) == pytest.approx(1.0, abs=1e-5)
        assert hit.normal @ d < 0
    assert hits > 30


def test_a_ray_on_the_flat_side_of_a_mesh_is_exact(level):
    mesh = level.colliders[MESH]
    for u, v in np.random.default_rng(1).uniform(-0.35, 0.35, (20, 2)):
        start = mesh.position + mesh.rotation @ [u, v, 3.0]
        hit = level.raycast(start, -mesh.rotation[:, 2], colliders=[mesh])
        assert hit.distance == pytest.approx(2.5, abs=2e-4)
        np.testing.assert_allclose(hit.normal, mesh.rotation[:, 2], atol=1e-3)


@pytest.mark.parametrize("kind", [SPHERE, BOX, CAPSULE, MESH])
def test_a_ray_from_inside_a_solid_leaves_it(level, kind):
    assert level.raycast(PLACES[kind], (0.3, 0.1, 1), bodies=[], colliders=[level.colliders[kind]]) is None


def closest_on_triangles(corners, point):
    """Distance of a point from triangles, through trimesh."""
    return np.linalg.norm(
        trimesh.triangles.closest_point(corners, np.tile(point, (len(corners), 1))) - point, axis=1
    ).min()


@pytest.mark.parametrize("kind", range(6))
def test_the_nearest_point_of_each_shape_is_at_its_distance(level, kind):
    collider = level.colliders[kind]
    random = np.random.default_rng(10 + kind)
    for _ in range(60):
        point = PLACES[kind] + random.uniform(-3, 3, 3)
        local = (point - collider.position) @ collider.rotation
        if kind == PLANE:
            expected = local[2]
        elif kind == SPHERE:
            expected = np.linalg.norm(local) - 0.8
        elif kind == CAPSULE:
            expected = np.linalg.norm(local - [0, 0, np.clip(local[2], -0.6, 0.6)]) - 0.4
        else:
            expected = closest_on_triangles(surface_of(collider), point)
            if kind == BOX and (np.abs(local) < [0.5, 1.0, 0.3]).all():
                expected = -expected
        found = level.closest_point(point, bodies=[], colliders=[collider])
        assert found.distance == pytest.approx(abs(expected), abs=0.05 if kind == MESH else 1e-5)
        assert np.linalg.norm(found.point - point) == pytest.approx(found.distance, abs=1e-5)
        assert (found.body, found.collider, found.triangle) == (None, collider, None)
        if kind < GROUND:
            assert found.is_inside == (expected < 0)


def test_the_nearer_of_body_and_collider_is_hit(level):
    body, ground = level.bodies[0], level.colliders[GROUND]
    ray = ((4, 8, 5), DOWN)
    assert level.raycast(*ray).body is body
    assert level.raycast(*ray, colliders=True).body is body
    below = level.raycast(*ray, bodies=[], colliders=True)
    assert (below.body, below.collider.index) == (None, PLANE)
    over_sphere = level.raycast((0, 0, 5), DOWN, colliders=True)
    assert over_sphere.collider.index == SPHERE
    assert level.raycast((0, 0, 5), DOWN) is None
    assert level.closest_point((4, 8, 3), colliders=True).body is body
    assert level.closest_point((0, 8, 1.5), colliders=True).collider is ground
    assert level.closest_point((0, 8, 1.5)).body is body


def test_one_ray_finds_what_many_find_to_the_bit(level):
    random = np.random.default_rng(3)
    targets = PLACES[random.integers(0, 6, 80)] + random.uniform(-0.5, 0.5, (80, 3))
    origins = targets + random.uniform([-3, -3, 2], [3, 3, 5], (80, 3))
    hits = level.raycasts(origins, targets - origins, colliders=True)
    kinds = set(hits.collider.tolist())
    assert len(kinds) >= 6
    for i in range(80):
        hit = level.raycast(origins[i], targets[i] - origins[i], colliders=True)
        if hit is None:
            assert (hits.body[i], hits.collider[i], hits.distance[i]) == (-1, -1, INF)
            continue
        index = -1 if hit.collider is None else hit.collider.index
        assert (index, hit.distance) == (hits.collider[i], hits.distance[i])
        assert hit.point.tobytes() == hits.point[i].tobytes()
        assert hit.normal.tobytes() == hits.normal[i].tobytes()


def test_groups_choose_bodies_and_colliders(jelly):
    world = bare_world(floor=None, gravity=(0, 0, 0))
    cube = world.add_body(box(cells=(1, 1, 1)), jelly, contact=Contact(group=2))
    roof = world.add_collider(BoxShape((3, 3, 0.1)), position=(0, 0, 2), group=4)
    world.build()
    ray = ((0, 0, 5), DOWN)
    assert world.raycast(*ray, colliders=True).collider is roof
    assert world.raycast(*ray, colliders=True, mask=2).body is cube
    assert world.raycast(*ray, colliders=True, mask=1) is None
    assert world.closest_point((0, 0, 5), colliders=True, mask=6).collider is roof
    assert world.closest_point((0, 0, 5), colliders=True, mask=2).body is cube
    assert world.overlap_sphere((0, 0, 0), 1.0, mask=4) == ()
    assert world.shapecast(SphereShape(0.1), *ray, mask=2).body is cube
    assert world.shapecast(SphereShape(0.1), *ray).collider is roof


def test_rays_hit_colliders_at_their_current_poses(jelly):
    world = bare_world(floor=0.0, collider_room=2)
    world.add_body(box(cells=(1, 1, 1)), jelly, position=(5, 0, 1))
    lift = world.add_collider(BoxShape((2, 2, 0.2)), position=(0, 0, 1.0))
    world.build()

    def height():
        return 5.0 - world.raycast((0, 0, 5), DOWN, colliders=True).distance

    assert height() == pytest.approx(1.1)
    lift.set_velocity((0, 0, 0.6))
    world.step(FixedStep(dt=1 / 60, substeps=4).dt)
    assert height() == pytest.approx(1.11, abs=1e-6)
    lift.teleport((0, 0, 2.0))
    assert height() == pytest.approx(2.1)
    stone = world.add_collider(SphereShape(0.5), position=(0, 0, 3.0))
    assert height() == pytest.approx(3.5)
    stone.remove()
    assert height() == pytest.approx(2.1)
    lift.remove()
    assert height() == pytest.approx(0.0, abs=1e-6)


def test_a_wall_stops_the_ray_of_a_grab_if_asked(jelly):
    world = bare_world(floor=None)
    cube = world.add_body(box(cells=(1, 1, 1)), jelly)
    world.add_collider(BoxShape((3, 3, 0.1)), position=(0, 0, 2))
    world.build()
    assert world.grab((0, 0, 5), DOWN, colliders=True) is None
    assert world.grab((0, 0, 1.5), DOWN, colliders=True).body is cube
    assert world.grab((0, 0, 5), DOWN).body is cube


def test_bad_targets_are_refused(level, jelly):
    other = bare_world(floor=None)
    stranger = other.add_collider(SphereShape(1.0))
    for query in (
        lambda **given: level.raycast((0, 0, 5), DOWN, **given),
        lambda **given: level.closest_point((0, 0, 5), **given),
        lambda **given: level.shapecast(SphereShape(0.1), (0, 0, 5), DOWN, **given),
    ):
        for bad in (5, [stranger], ["floor"], None):
            with pytest.raises(OptionError, match="colliders must be True, False or a list"):
                query(colliders=bad)
        with pytest.raises(OptionError, match="mask"):
            query(mask=-1)
    flat = World(schedule="flat")
    flat.add_body(box(cells=(1, 1, 1)), jelly, position=(0, 0, 1))
    flat.build()
    with pytest.raises(StateError, match="queries on colliders"):
        flat.raycast((0, 0, 5), DOWN, colliders=True)
