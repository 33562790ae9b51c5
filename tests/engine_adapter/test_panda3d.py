"""Panda3D, off screen: drawn bodies, colliders that follow nodes, and impulses on rigid bodies."""

import re
from itertools import combinations
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

pytest.importorskip("panda3d", reason="needs panda3d: pip install 'taichi-soft[panda3d]'")

from direct.showbase.ShowBase import ShowBase
from panda3d import bullet, core
from PIL import Image

import engine_adapter.panda3d
from engine_adapter import EngineAdapter, FixedStep
from engine_adapter.panda3d import (
    BulletCoupling,
    DebugNode,
    MouseGrab,
    SoftBodyNode,
    SoftBodyTask,
    add_colliders,
)
from taichi_soft import Material, OptionError, SoftBodyAsset, box
from taichi_soft.world.bare import bare_world

DT, EDGE, MASS, WEIGHT = 1 / 60, 0.6, 60.0, 9.81
SKY = (51, 102, 204)


@pytest.fixture(scope="module")
def base():
    """A game without a window, whose clock makes frames of 1/60 s."""
    core.load_prc_file_data("", "load-display p3tinydisplay\naudio-library-name null\nwin-size 320 240")
    core.load_prc_file_data("", "background-color 0.2 0.4 0.8")
    game = ShowBase(windowType="offscreen")
    game.disable_mouse()
    clock = core.ClockObject.get_global_clock()
    clock.mode, clock.dt = core.ClockObject.M_non_real_time, DT
    yield game
    game.destroy()


def textured_block():
    """A cube of 0.6 m with a picture of four colours on each side."""
    mesh = trimesh.creation.box((0.6, 0.6, 0.6))
    mesh = trimesh.Trimesh(mesh.triangles.reshape(-1, 3), np.arange(36).reshape(-1, 3), process=False)
    sides = np.abs(mesh.face_normals).argmax(axis=1).repeat(3)
    flat = np.array([np.delete(v, k) for v, k in zip(mesh.vertices, sides, strict=True)])
    pixels = np.zeros((64, 64, 3), np.uint8)
    pixels[:32, :32], pixels[:32, 32:] = (250, 0, 0), (0, 250, 0)
    pixels[32:, :32], pixels[32:, 32:] = (0, 0, 250), (250, 250, 0)
    visual = trimesh.visual.TextureVisuals(uv=flat / 0.6 + 0.5, image=Image.fromarray(pixels))
    return trimesh.Trimesh(mesh.vertices, mesh.faces, visual=visual, process=False)


@pytest.fixture(scope="module")
def world():
    """A plain block of 720 kg that can be cut, and one with a textured skin, both at rest on the floor."""
    made = bare_world(floor=0.0, friction=0.8, collider_room=8)
    jelly = Material(young=6e4, poisson=0.3, density=1000, damping_ratio=0.3)
    plain = SoftBodyAsset(box((1.2, 1.2, 0.5), (8, 8, 4)), jelly, spare_vertices=200)
    made.add_body(plain, position=(0, 0, 0.26))
    made.reserve(plain, 1)
    made.add_body(SoftBodyAsset.from_surface(textured_block(), jelly, cells=4), position=(4, 0, 0.31))
    made.build()
    for _ in range(60):
        made.step(DT)
    return made


@pytest.fixture
def play(base, world):
    """Return the world at rest, without colliders except the floor.

    The scene contains only a camera that looks at the origin.
    """
    if not hasattr(world, "at_rest"):
        world.at_rest = world.snapshot()
    world.restore(world.at_rest)
    base.camera.set_pos(0, -5, 2)
    base.camera.look_at(0, 0, 0.3)
    base.render.clear_light()
    yield world
    for each in world.colliders:
        if each.is_alive and each is not world.floor_collider:
            each.remove()
    for node in base.render.get_children():
        if node != base.camera:
            node.remove_node()


def picture(base):
    """Return the camera's image, uint8 (height, width, 3), first row at the top."""
    base.graphicsEngine.render_frame()
    shot = base.win.get_screenshot()
    rows = np.frombuffer(bytes(shot.get_ram_image_as("RGB")), np.uint8)
    return rows.reshape(shot.get_y_size(), shot.get_x_size(), 3)[::-1].astype(int)


def drawn(pixels):
    """Return True for pixels that do not show the background."""
    return (np.abs(pixels - SKY) > 3).any(axis=2)


def column(node, geom, array, width):
    """Return the current contents of a column of a node's vertex buffers, float32 (n, width)."""
    data = node.node().get_geom(geom).get_vertex_data().get_array(array)
    return np.frombuffer(memoryview(data).tobytes(), np.float32).reshape(-1, width)


def on_screen(base, point):
    """Return the position of a point of the world in the window, from -1 to 1."""
    spot = core.LPoint2()
    assert base.camLens.project(base.cam.get_relative_point(base.render, core.LPoint3(*point)), spot)
    return spot.x, spot.y


def make_crate(base, rigid, position, *shapes):
    """A rigid body of MASS of Bullet: a cube of EDGE, or what is given as (half edges, place)."""
    crate = base.render.attach_new_node(bullet.BulletRigidBodyNode("crate"))
    crate.set_pos(*position)
    for half, place in shapes or (((EDGE / 2,) * 3, (0, 0, 0)),):
        shape = bullet.BulletBoxShape(core.LVector3(*half))
        crate.node().add_shape(shape, core.TransformState.make_pos(core.LPoint3(*place)))
    crate.node().set_mass(MASS)
    rigid.attach(crate.node())
    return crate


def bullet_world(gravity=WEIGHT):
    rigid = bullet.BulletWorld()
    rigid.set_gravity(core.LVector3(0, 0, -gravity))
    return rigid


def test_every_public_name_is_on_the_page_of_the_reference_once():
    page = Path(__file__).parents[2] / "docs" / "reference" / "panda3d.md"
    listed = re.findall(
        r"^::: engine_adapter\.panda3d\.(\w+)$", page.read_text(encoding="utf-8"), re.MULTILINE
    )
    assert sorted(listed) == sorted(engine_adapter.panda3d.__all__)


# What is drawn.


@pytest.mark.parametrize("number", [0, 1])
def test_panda3ds_buffers_hold_what_the_adapter_gives_to_the_bit(play, number):
    adapter, body = EngineAdapter(play, FixedStep(dt=DT)), play.bodies[number]
    node = SoftBodyNode(adapter, body)
    body.set_velocity((0.5, 0.2, 1.0), angular=(0, 1, 3))
    adapter.advance(3.25 * DT)
    node.draw()
    (mesh,) = node.meshes
    positions, normals = adapter.render_mesh(mesh)
    assert np.ptp(positions[:, 2]) > 0.1
    assert column(node, 0, 0, 3).tobytes() == positions.tobytes()
    assert column(node, 0, 1, 3).tobytes() == normals.tobytes()
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-5)
    primitive = node.node().get_geom(0).get_primitive(0)
    corners = np.frombuffer(memoryview(primitive.get_vertices()).tobytes(), np.uint32)
    assert corners.reshape(-1, 3).tolist() == mesh.triangles.tolist()


def test_a_frame_is_written_into_the_memory_of_the_last_one(play):
    node = SoftBodyNode(EngineAdapter(play), play.bodies[0])

    def places():
        data = node.node().modify_geom(0).modify_vertex_data()
        views = (memoryview(data.modify_array(k)).cast("B") for k in (0, 1))
        return [np.frombuffer(view, np.float32).ctypes.data for view in views]

    before = places()
    play.step(DT)
    node.draw()
    assert places() == before


def test_a_body_that_moves_into_the_picture_is_drawn_there(base, play):
    """Panda3D omits nodes whose bounds are outside the image, so the bounds must move with the body."""
    adapter, body = EngineAdapter(play), play.bodies[0]
    body.teleport((0, 0, 300))
    adapter.step()
    node = SoftBodyNode(adapter, body)
    node.reparent_to(base.render)
    assert not drawn(picture(base)).any()
    body.teleport((0, 0, 0.26))
    adapter.step()
    adapter.advance(0.999 * DT)
    node.draw()
    assert drawn(picture(base)).mean() > 0.05


def test_pixels_are_those_of_the_triangles_that_face_the_camera(base, play):
    """A closed body looks the same where triangles seen from behind are drawn as well."""
    node = SoftBodyNode(EngineAdapter(play), play.bodies[0])
    node.reparent_to(base.render)
    sun = core.DirectionalLight("sun")
    sun.direction = core.LVector3(0.5, 0.8, -1.2)
    base.render.set_light(base.render.attach_new_node(sun))
    one_sided = picture(base)
    node.set_two_sided(True)
    assert (picture(base) != one_sided).any(axis=2).mean() < 0.005  # pixels on the outline
    assert one_sided[drawn(one_sided)].max() > 150  # the top faces the sun
    node.set_two_sided(False)
    node.set_attrib(core.CullFaceAttrib.make(core.CullFaceAttrib.M_cull_counter_clockwise))
    assert (picture(base) != one_sided).any(axis=2).mean() > 0.05


def test_the_texture_lies_where_trimesh_has_it(base, play):
    """Colours of pixels at the corners of triangles, a little within, are those that trimesh looks up."""
    body = play.bodies[1]
    node = SoftBodyNode(EngineAdapter(play), body)
    node.reparent_to(base.render)
    base.camera.set_pos(4.9, -1.6, 1.5)
    base.camera.look_at(4, 0, 0.3)
    pixels = picture(base)
    (mesh,) = node.meshes
    places, seen = column(node, 0, 0, 3), 0
    np.testing.assert_array_equal(column(node, 0, 2, 2), mesh.visual.uv.astype(np.float32))
    eye = np.array(base.camera.get_pos())
    for corners in mesh.triangles:
        a, b, c = places[corners].astype(float)
        if np.cross(b - a, c - a) @ (eye - a) <= 0:
            continue  # this triangle faces away
        for near in range(3):
            share = np.full(3, 0.1)
            share[near] = 0.8
            u = share @ mesh.visual.uv[corners]
            if np.abs(u - 0.5).min() < 0.08:
                continue  # at the border of two colours
            expected = trimesh.visual.color.uv_to_color(u[None], mesh.visual.material.image)[0, :3]
            spot = base.cam.get_relative_point(base.render, core.LPoint3(*(share @ places[corners])))
            point = core.LPoint2()
            assert base.camLens.project(spot, point)
            row, line = round((1 - point.y) * 120 - 0.5), round((point.x + 1) * 160 - 0.5)
            np.testing.assert_allclose(pixels[row, line], expected, atol=12)
            seen += 1
    assert seen >= 12


def test_a_mesh_with_colours_of_its_own_is_drawn_in_them(base):
    """The colours are those of its vertices or of its material.

    A colour of the node with a priority overrides them.
    """
    jelly = Material(young=6e4, poisson=0.3, density=1000)
    one, other = trimesh.creation.box((0.6, 0.6, 0.6)), trimesh.creation.box((0.6, 0.6, 0.6))
    one.visual.vertex_colors = (250, 100, 0, 255)
    plain = trimesh.visual.material.PBRMaterial(baseColorFactor=(0, 100, 50, 255))
    other.visual = trimesh.visual.TextureVisuals(material=plain)
    world = bare_world(floor=None)
    for x, mesh in ((-1, one), (1, other)):
        world.add_body(SoftBodyAsset.from_surface(mesh, jelly, cells=3), position=(x, 0, 0))
    world.build()
    nodes = [SoftBodyNode(EngineAdapter(world), body) for body in world.bodies]
    for node in nodes:
        node.reparent_to(base.render)
    base.camera.set_pos(0, -5, 0)
    base.camera.look_at(0, 0, 0)
    base.render.clear_light()
    pixels = picture(base)
    left, right = (round((on_screen(base, (x, -0.3, 0))[0] + 1) * 160) for x in (-1, 1))
    np.testing.assert_allclose(pixels[120, left], (250, 100, 0), atol=3)
    np.testing.assert_allclose(pixels[120, right], (0, 100, 50), atol=3)
    nodes[1].set_color(1, 0, 0, 1, 1)
    np.testing.assert_allclose(picture(base)[120, right], (255, 0, 0), atol=3)
    for node in nodes:
        node.remove_node()


def test_a_cut_body_gets_buffers_for_its_new_vertices(play):
    adapter, body = EngineAdapter(play), play.bodies[0]
    node = SoftBodyNode(adapter, body)
    before = len(column(node, 0, 0, 3))
    (piece,) = body.cut(plane=((0.02, 0, 0), (1, 0, 0)))
    node.draw()
    (mesh,) = node.meshes
    assert mesh.vertex_count == len(column(node, 0, 0, 3)) < before
    assert len(column(SoftBodyNode(adapter, piece), 0, 0, 3)) < before


def test_a_removed_body_is_not_drawn_until_restore_brings_it_back(play):
    adapter, body = EngineAdapter(play), play.bodies[0]
    node = SoftBodyNode(adapter, body)
    before = adapter.snapshot()
    play.despawn(body)
    node.draw()
    assert (node.node().get_num_geoms(), node.meshes) == (0, ())
    adapter.restore(before)
    node.draw()
    assert column(node, 0, 0, 3).tobytes() == adapter.render_mesh(node.meshes[0])[0].tobytes()


def test_the_task_gives_the_world_the_time_of_each_frame_and_draws(base, play):
    adapter, body = EngineAdapter(play, FixedStep(dt=DT)), play.bodies[0]
    node = SoftBodyNode(adapter, body)
    body.set_velocity((0, 0, 3))
    task = SoftBodyTask(base, adapter, [node])
    base.task_mgr.step()
    start, before = play.step_count, column(node, 0, 0, 3)
    for _ in range(10):
        base.task_mgr.step()
    assert abs(play.step_count - start - 10) <= 1  # the clock's time is rounded
    moved = column(node, 0, 0, 3) - before
    expected = 3 * 10 * DT - 9.81 / 2 * (10 * DT) ** 2
    assert moved[:, 2].mean() == pytest.approx(expected, abs=4 * DT)
    task.remove()
    base.task_mgr.step()
    assert abs(play.step_count - start - 10) <= 1


# Debug lines.


def test_debug_lines_follow_bodies_and_colliders_and_cost_nothing_while_hidden(base, play):
    adapter = EngineAdapter(play)
    path = base.render.attach_new_node(core.CollisionNode("ball"))
    path.node().add_solid(core.CollisionSphere(0, 0, 0, 0.5))
    path.set_pos(0, 3, 1)
    (ball,) = add_colliders(play, path)
    node = DebugNode(adapter)
    adapter.step()
    node.draw()
    ends = column(node, 0, 0, 3)
    lines = {frozenset(map(tuple, pair)) for pair in ends.reshape(-1, 2, 3).tolist()}
    for body in play.bodies:
        rows = [tuple(row) for row in adapter.positions(body).tolist()]
        pairs = {frozenset(pair) for tet in body.tets.tolist() for pair in combinations(tet, 2)}
        assert {frozenset(rows[vertex] for vertex in pair) for pair in pairs} <= lines
    on_ball = np.abs(np.linalg.norm(ends - (0, 3, 1), axis=1) - 0.5) < 1e-5
    assert on_ball.sum() > 100
    grab = play.grab((0, 0, 5), (0, 0, -1))
    node.draw()
    crosses = len(column(node, 0, 0, 3)) - len(ends)
    assert crosses == 6
    grab.release()
    node.hide()
    node.draw()
    assert node.node().get_num_geoms() == 0
    ball.collider.remove()


# Who pushes whom.


def test_a_platform_of_the_scene_carries_a_body_along(base, play):
    """The body moves as far as the platform. Without the coupling, the body stays in place."""
    for follows in (True, False):
        play.restore(play.at_rest)
        platform = base.render.attach_new_node(core.CollisionNode("platform"))
        platform.node().add_solid(core.CollisionBox(core.LPoint3(0), 1, 1, 0.1))
        platform.set_pos(0, 3, 0.1)
        (collider,) = add_colliders(play, platform, friction=0.8)
        body = play.bodies[0]
        body.teleport((0, 3, 0.46))

        first = play.step_count

        def before_step(_, first=first, platform=platform, collider=collider, follows=follows):
            if 60 < play.step_count - first <= 180:
                platform.set_x(platform.get_x() + 0.5 * DT)
                if follows:
                    collider.follow()

        adapter = EngineAdapter(play, FixedStep(dt=DT), before_step=before_step)
        for _ in range(240):
            adapter.step()
        assert platform.get_x() == pytest.approx(1.0, abs=1e-3)
        assert body.center_of_mass()[0] == pytest.approx(1.0 if follows else 0.0, abs=0.03)
        assert body.aabb()[0][2] > 0.19
        collider.collider.remove()


HALVES = [((EDGE / 4, EDGE / 2, EDGE / 2), (side * EDGE / 4, 0, 0)) for side in (-1, 1)]


@pytest.mark.parametrize("shapes", [[], HALVES], ids=["one shape", "two halves"])
def test_a_rigid_crate_lies_on_a_soft_block_sinks_in_and_presses_with_its_weight(base, play, shapes):
    rigid = bullet_world()
    crate = make_crate(base, rigid, (0.02, 0, 0.5 + EDGE / 2 + 0.1), *shapes)
    coupling = BulletCoupling(play, rigid)
    colliders = coupling.add(crate)
    adapter = EngineAdapter(play, FixedStep(dt=DT), before_step=lambda _: coupling.step(DT))
    presses = []
    for _ in range(300):
        adapter.step()
        presses.append(sum(each.collider.impulse for each in colliders))
    weight = MASS * WEIGHT * DT
    np.testing.assert_allclose(np.mean(presses[-120:], axis=0), (0, 0, weight), atol=0.03 * weight)
    assert 0.5 - 0.08 < crate.get_z() - EDGE / 2 < 0.5 - 0.01
    assert np.abs(list(crate.get_hpr())[1:]).max() < 5.0  # degrees
    coupling.remove(crate)
    assert not any(each.collider.is_alive for each in colliders)


def test_a_rigid_crate_and_a_soft_block_that_meet_in_flight_keep_their_momentum(base, play):
    """Without gravity; also their angular momentum about the origin, and the energy does not grow."""
    rigid, block = bullet_world(gravity=0.0), play.bodies[0]
    block.set_gravity_scale(0.0)
    block.teleport((0, 0, 3))
    block.set_velocity((0, 0, 0))
    crate = make_crate(base, rigid, (0.2, 0.1, 4.5))
    crate.node().set_linear_velocity(core.LVector3(0, 0, -3))
    coupling = BulletCoupling(play, rigid)
    coupling.add(crate)
    inertia = MASS * EDGE**2 / 6

    def totals():
        node = crate.node()
        speed, spin = np.array(node.get_linear_velocity()), np.array(node.get_angular_velocity())
        momentum = MASS * speed + block.momentum()
        turning = inertia * spin + MASS * np.cross(np.array(crate.get_pos()), speed)
        rows, masses = block.positions().astype(float), block.masses[:, None]
        turning = turning + np.cross(rows, masses * block.velocities()).sum(axis=0)
        energy = MASS * speed @ speed / 2 + inertia * spin @ spin / 2 + block.kinetic_energy()
        return momentum, turning, energy

    adapter = EngineAdapter(play, FixedStep(dt=DT), before_step=lambda _: coupling.step(DT))
    before = totals()
    for _ in range(120):
        adapter.step()
    after = totals()
    assert block.momentum()[2] < -60.0  # of the 180 N s that the crate brought
    np.testing.assert_allclose(after[0], before[0], atol=0.002 * 180)
    np.testing.assert_allclose(after[1], before[1], atol=0.02 * 540)
    assert after[2] < before[2]


def test_weight_times_time_is_what_crate_and_block_and_floor_exchange(base, play):
    """Momentum of both grows by what the floor gives less their weight times the time."""
    rigid, block = bullet_world(), play.bodies[0]
    crate = make_crate(base, rigid, (0.02, 0, 0.5 + EDGE / 2 + 0.3))
    coupling = BulletCoupling(play, rigid)
    coupling.add(crate)
    play.bodies[1].teleport((4, 0, 50))  # so that it exerts no force on the floor
    adapter = EngineAdapter(play, FixedStep(dt=DT), before_step=lambda _: coupling.step(DT))
    before = block.momentum()[2]
    floor, steps = 0.0, 90
    for _ in range(steps):
        adapter.step()
        floor -= play.floor_collider.impulse[2]
    grown = block.momentum()[2] + MASS * crate.node().get_linear_velocity()[2] - before
    weight = (block.masses.sum() + MASS) * WEIGHT * steps * DT
    assert weight > 1e4
    assert grown == pytest.approx(floor - weight, abs=1.6 * MASS * WEIGHT * DT)


def test_a_rigid_body_gets_half_of_an_impulse_in_advance_and_gives_it_back_a_step_later(base, play):
    """docs/coupling.md describes this scheme.

    In total, the rigid body receives the impulse that the soft body exerts.
    """
    rigid = bullet_world()
    crate = make_crate(base, rigid, (0.02, 0, 0.5 + EDGE / 2 + 0.05))
    coupling = BulletCoupling(play, rigid)
    (one,) = coupling.add(crate)
    speeds, impulses = [0.0], [0.0]
    for _ in range(40):
        coupling.step(DT)
        play.step(DT)
        speeds.append(crate.node().get_linear_velocity()[2])
        impulses.append(one.collider.impulse[2])
    given = 1.5 * np.array(impulses[1:-1]) - 0.5 * np.array(impulses[:-2])
    assert np.ptp(given) > MASS * WEIGHT * DT
    np.testing.assert_allclose(np.diff(speeds)[1:], given / MASS - WEIGHT * DT, atol=1e-5)


def test_what_was_put_back_with_the_world_moves_on_as_before(base, play):
    rigid = bullet_world()
    crate = make_crate(base, rigid, (0.1, 0, 0.5 + EDGE / 2 + 0.1))
    coupling = BulletCoupling(play, rigid)
    coupling.add(crate)
    adapter = EngineAdapter(play, FixedStep(dt=DT), before_step=lambda _: coupling.step(DT))
    for _ in range(20):
        adapter.step()
    kept = adapter.snapshot(), coupling.snapshot()
    ways = []
    for _ in range(2):
        adapter.restore(kept[0])
        coupling.restore(kept[1])
        way = []
        for _ in range(30):
            adapter.step()
            way.append([*crate.get_pos(), *play.bodies[0].center_of_mass()])
        ways.append(way)
        crate.set_pos(5, 5, 5)
    # Bullet keeps no impulses, so that the crate lands a little differently.
    np.testing.assert_allclose(ways[0], ways[1], atol=5e-3)
    assert np.ptp(np.array(ways[0])[:, 2]) > 1e-3
    coupling.remove(crate)
    with pytest.raises(OptionError, match=r"rigid bodies were .*same set"):
        coupling.restore(kept[1])


def test_the_same_game_comes_out_the_same_to_the_bit(base, play):
    ends = []
    for _ in range(2):
        play.restore(play.at_rest)
        rigid = bullet_world()
        crate = make_crate(base, rigid, (0.1, 0, 0.5 + EDGE / 2 + 0.1))
        coupling = BulletCoupling(play, rigid)
        (one,) = coupling.add(crate)
        adapter = EngineAdapter(play, FixedStep(dt=DT), before_step=lambda _, c=coupling: c.step(DT))
        for frame_dt in (0.5 * DT, 2.7 * DT, DT) * 10:
            adapter.advance(frame_dt)
        assert abs(one.collider.impulse[2]) > 0.0
        ends.append([row.tobytes() for body in play.bodies for row in (body.positions(), body.velocities())])
        coupling.remove(crate)
        crate.remove_node()
    assert ends[0] == ends[1]


def test_what_pushes_only_is_not_pushed(base, play):
    """This holds for Bullet's bodies without mass, and for bodies that the game moves."""
    rigid = bullet_world()
    for is_kinematic in (False, True):
        crate = make_crate(base, rigid, (0, 0, 0.5 + EDGE / 2 - 0.05))
        crate.node().set_mass(MASS if is_kinematic else 0.0)
        crate.node().set_kinematic(is_kinematic)
        coupling = BulletCoupling(play, rigid)
        (one,) = coupling.add(crate)
        for _ in range(20):
            coupling.step(DT)
            play.step(DT)
        assert one.collider.impulse[2] > 1.0
        assert crate.get_z() == pytest.approx(0.5 + EDGE / 2 - 0.05)
        coupling.remove(crate)


def test_a_node_is_coupled_once_and_only_rigid_bodies_are(base, play):
    rigid = bullet_world()
    crate = make_crate(base, rigid, (0, 0, 5))
    coupling = BulletCoupling(play, rigid)
    coupling.add(crate)
    with pytest.raises(OptionError, match="'crate' was already added"):
        coupling.add(crate)
    with pytest.raises(OptionError, match=r"'ghost'.*BulletRigidBodyNode.*BulletGhostNode"):
        coupling.add(base.render.attach_new_node(bullet.BulletGhostNode("ghost")))
    with pytest.raises(OptionError, match="'other' was not added"):
        coupling.remove(core.NodePath("other"))
    with pytest.raises(OptionError, match=r"bullet_world.*BulletWorld, got World"):
        BulletCoupling(play, play)


# The mouse.


def test_a_body_in_hand_follows_the_line_of_sight_through_the_mouse(base, play):
    body = play.bodies[0]
    mouse = MouseGrab(base, play, button=None)
    x, y = on_screen(base, body.center_of_mass())
    assert mouse.press(x, y)
    picked = mouse.grab.point
    assert play.closest_point(picked).distance < 1e-3
    adapter = EngineAdapter(play, FixedStep(dt=DT))
    for k in range(120):
        part = min(k / 60, 1.0)
        mouse.move(x + 0.3 * part, y + 0.4 * part)
        adapter.step()
    target = mouse.grab.point
    assert np.linalg.norm(target - picked) > 0.5
    np.testing.assert_allclose(on_screen(base, target), (x + 0.3, y + 0.4), atol=1e-4)
    forward = np.array(base.render.get_relative_vector(base.cam, core.LVector3.forward()))
    assert (target - picked) @ forward == pytest.approx(0.0, abs=1e-4)
    near, far = mouse.ray(x + 0.3, y + 0.4)
    hit = play.raycast(near, far - near)
    assert hit.body is body
    np.testing.assert_allclose(hit.point, target, atol=0.1)
    mouse.release()
    assert mouse.grab is None
    assert len(play.grabs) == 0


def test_beside_all_bodies_the_mouse_takes_hold_of_nothing(base, play):
    mouse = MouseGrab(base, play, button=None)
    assert not mouse.press(0.0, 0.95)
    mouse.move(0.1, 0.1)
    mouse.release()
    assert not MouseGrab(base, play, button=None, bodies=[play.bodies[1]]).press(
        *on_screen(base, play.bodies[0].center_of_mass())
    )


def test_the_button_takes_hold_the_mouse_moves_and_a_body_that_is_gone_is_let_go(base, play, monkeypatch):
    body = play.bodies[0]
    at = list(on_screen(base, body.center_of_mass()))
    watcher = SimpleNamespace(has_mouse=lambda: True, get_mouse_x=lambda: at[0], get_mouse_y=lambda: at[1])
    monkeypatch.setattr(base, "mouseWatcherNode", watcher)
    mouse = MouseGrab(base, play)
    base.messenger.send("mouse1")
    picked = mouse.grab.point
    at[1] += 0.2
    base.task_mgr.step()
    assert mouse.grab.point[2] > picked[2] + 0.1
    base.messenger.send("mouse1-up")
    assert mouse.grab is None
    base.messenger.send("mouse1")
    assert mouse.grab is not None
    base.messenger.send("mouse1-up")
    at[1] = 0.95
    base.messenger.send("mouse1")
    assert mouse.grab is None  # the mouse is above all bodies now
    at[:] = on_screen(base, body.center_of_mass())
    base.messenger.send("mouse1")
    assert mouse.grab is not None
    play.despawn(body)
    base.task_mgr.step()
    assert mouse.grab is None
    base.ignore_all()
    base.task_mgr.remove("soft body mouse")


@pytest.mark.parametrize("make", [SoftBodyTask, SoftBodyNode, DebugNode, MouseGrab])
def test_what_is_no_adapter_and_no_world_is_refused_by_name(base, play, make):
    arguments = {
        SoftBodyTask: (base, play),
        MouseGrab: (base, 3),
        SoftBodyNode: (play, None),
        DebugNode: (play,),
    }
    with pytest.raises(OptionError, match="must be a"):
        make(*arguments[make])
