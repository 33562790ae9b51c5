"""Shapes from solids of Panda3D and Bullet: their surfaces agree with rays of the engine."""

import numpy as np
import pytest

pytest.importorskip("panda3d", reason="needs panda3d: pip install 'taichi-soft[panda3d]'")

from panda3d import bullet, core

from engine_adapter.panda3d import add_colliders, shapes_of
from taichi_soft import BoxShape, CapsuleShape, OptionError, PlaneShape, SphereShape
from taichi_soft.world.bare import bare_world

P = core.LPoint3
SOLIDS = {
    "sphere": (core.CollisionSphere(0.3, -0.2, 0.5, 0.7), SphereShape),
    "box": (core.CollisionBox(P(-0.3, -0.5, 0.1), P(0.6, 0.4, 0.9)), BoxShape),
    "capsule": (core.CollisionCapsule(0.1, 0.2, -0.4, 0.7, -0.5, 0.6, 0.3), CapsuleShape),
    "ball of a capsule": (core.CollisionCapsule(0.1, 0.2, 0.4, 0.1, 0.2, 0.4, 0.3), CapsuleShape),
    "plane": (core.CollisionPlane(core.LPlane(core.LVector3(1, -2, 4), P(0.1, 0.2, 0.3))), PlaneShape),
}
BULLET = {
    "sphere": (bullet.BulletSphereShape(0.7), SphereShape(0.7)),
    "box": (bullet.BulletBoxShape(core.LVector3(0.3, 0.5, 0.8)), BoxShape((0.6, 1.0, 1.6))),
    "capsule along x": (bullet.BulletCapsuleShape(0.3, 0.9, bullet.XUp), CapsuleShape(0.3, 0.9)),
    "capsule along y": (bullet.BulletCapsuleShape(0.3, 0.9, bullet.YUp), CapsuleShape(0.3, 0.9)),
    "capsule along z": (bullet.BulletCapsuleShape(0.3, 0.9, bullet.ZUp), CapsuleShape(0.3, 0.9)),
    "plane": (bullet.BulletPlaneShape(core.LVector3(0.6, 0, 0.8), 0.25), PlaneShape((0.6, 0, 0.8))),
}


def rays(count):
    """Return rays from outside through the middle of the scene, as ends (count, 2, 3)."""
    random = np.random.default_rng(3)
    starts = random.normal(size=(count, 3))
    starts *= 4 / np.linalg.norm(starts, axis=1, keepdims=True)
    aims = np.array((0.5, -0.5, 0.5)) + random.uniform(-1.2, 1.2, (count, 3))  # about where shapes are
    return np.stack([starts, 2 * aims - starts], axis=1)


def depths(path, points):
    """Return the depth of points (n, 3) of the world in the only shape of a node."""
    (placed,) = shapes_of(path)
    position, rotation = placed.pose(path)
    return placed.shape.depths((points - position) @ rotation)


def placed_node(node, scale=1.0):
    """Below another node, both moved and turned."""
    above = core.NodePath("above")
    above.set_pos_hpr_scale(0.4, -0.3, 0.2, 30, 20, -50, scale, scale, scale)
    path = above.attach_new_node(node)
    path.set_pos_hpr(0.1, 0.2, 0.3, -70, 15, 40)
    return above, path


@pytest.mark.parametrize("scale", [1.0, 1.7])
@pytest.mark.parametrize("kind", SOLIDS)
def test_rays_of_panda3d_end_on_the_surface_of_the_shape(kind, scale):
    solid, expected = SOLIDS[kind]
    node = core.CollisionNode(kind)
    node.add_solid(solid)
    above, path = placed_node(node, scale)
    root = core.NodePath("root")
    above.reparent_to(root)
    assert type(shapes_of(path)[0].shape) is expected
    seeker = core.CollisionNode("seeker")
    seeker.set_into_collide_mask(core.BitMask32.all_off())
    seeker_path = root.attach_new_node(seeker)
    traverser, queue = core.CollisionTraverser(), core.CollisionHandlerQueue()
    traverser.add_collider(seeker_path, queue)
    hits = []
    for start, end in rays(1500):
        seeker.clear_solids()
        seeker.add_solid(core.CollisionRay(P(*start), core.LVector3(*(end - start))))
        traverser.traverse(root)
        if queue.get_num_entries() and depths(path, start[None])[0] < 0:
            queue.sort_entries()
            hits.append([*queue.get_entry(0).get_surface_point(root)])
    assert len(hits) > 60
    np.testing.assert_allclose(depths(path, np.array(hits)), 0.0, atol=1e-4)


@pytest.mark.parametrize("kind", BULLET)
def test_rays_of_bullet_end_on_the_surface_of_the_shape(kind):
    shape, expected = BULLET[kind]
    node = bullet.BulletRigidBodyNode(kind)
    local = core.TransformState.make_pos_hpr(P(0.2, -0.1, 0.15), core.LVecBase3(25, -35, 10))
    node.add_shape(shape, local)
    above, path = placed_node(node)
    above.reparent_to(core.NodePath("root"))
    (placed,) = shapes_of(path)
    assert type(placed.shape) is type(expected)
    np.testing.assert_allclose(placed.shape.parameters, expected.parameters, rtol=1e-6)
    world = bullet.BulletWorld()
    world.attach(node)
    world.do_physics(1e-3, 0)
    hits = []
    for start, end in rays(1500):
        found = world.ray_test_closest(P(*start), P(*end))
        if found.has_hit() and depths(path, start[None])[0] < 0:
            hits.append([*found.get_hit_pos()])
    assert len(hits) > 60
    off = np.abs(depths(path, np.array(hits)))
    assert np.percentile(off, 95) < 0.01  # Bullet's rays are off by millimetres, grazing ones by more


def test_colliders_of_a_whole_scene_are_where_their_nodes_are():
    world, root = bare_world(), core.NodePath("root")
    level = root.attach_new_node(core.CollisionNode("level"))
    level.node().add_solid(SOLIDS["box"][0])
    level.node().add_solid(SOLIDS["sphere"][0])
    level.set_pos(0, 0, 2)
    stone = level.attach_new_node(bullet.BulletRigidBodyNode("stone"))
    stone.node().add_shape(bullet.BulletSphereShape(0.7))
    stone.node().set_friction(0.9)
    stone.set_pos(0, 3, 0)
    made = add_colliders(world, root)
    assert [type(each.collider.shape) for each in made] == [BoxShape, SphereShape, SphereShape]
    np.testing.assert_allclose(made[0].collider.position, (0.15, -0.05, 2.5), atol=1e-6)
    np.testing.assert_allclose(made[1].collider.position, (0.3, -0.2, 2.5), atol=1e-6)
    np.testing.assert_allclose(made[2].collider.position, (0, 3, 2), atol=1e-6)
    assert [each.collider.friction for each in made] == pytest.approx([0.5, 0.5, 0.9])
    level.set_pos(1, 0, 2)
    for each in made:
        each.teleport()
    np.testing.assert_allclose(made[2].collider.position, (1, 3, 2), atol=1e-6)
    assert len(world.colliders) == 3


def node_with(solid):
    if isinstance(solid, core.CollisionSolid):
        node = core.CollisionNode("n")
        node.add_solid(solid)
    else:
        node = bullet.BulletRigidBodyNode("n")
        node.add_shape(solid)
    return core.NodePath(node)


@pytest.mark.parametrize(
    "solid",
    [
        core.CollisionInvSphere(0, 0, 0, 1),
        core.CollisionPolygon(P(0, 0, 0), P(1, 0, 0), P(0, 1, 0)),
        core.CollisionRay(0, 0, 0, 0, 0, 1),
        bullet.BulletCylinderShape(0.3, 1.0),
        bullet.BulletConeShape(0.3, 1.0),
        bullet.BulletMultiSphereShape([P(0, 0, 0)], [0.5]),
    ],
    ids=lambda solid: type(solid).__name__,
)
def test_a_solid_without_such_a_shape_is_refused_by_name_with_nothing_added(solid):
    world, path = bare_world(), core.NodePath("scene")
    node_with(core.CollisionSphere(0, 0, 0, 1)).reparent_to(path)
    node_with(solid).reparent_to(path)
    with pytest.raises(OptionError, match=rf"{type(solid).__name__} .*'n'.*Sphere"):
        add_colliders(world, path)
    assert len(world.colliders) == 0


def test_scales_that_a_shape_cannot_have_are_refused():
    path = node_with(core.CollisionSphere(0, 0, 0, 1))
    for scale in ((1, 2, 1), (-1, -1, -1)):
        path.set_scale(*scale)
        with pytest.raises(OptionError, match=r"'n'.*one scale above 0"):
            shapes_of(path)
    path.set_scale(1)
    path.set_shear(0.5, 0, 0)
    with pytest.raises(OptionError, match=r"no shear, got scale .* and shear \[0.5"):
        shapes_of(path)
    path = node_with(bullet.BulletSphereShape(1))
    path.set_scale(2)
    with pytest.raises(OptionError, match="'n' of Bullet is scaled"):
        shapes_of(path)
    with pytest.raises(OptionError, match=r"'plain'.*CollisionNode.*Bullet"):
        shapes_of(core.NodePath("plain"))
    with pytest.raises(OptionError, match=r"CollisionNode.*Bullet"):
        add_colliders(bare_world(), core.NodePath("plain"))
