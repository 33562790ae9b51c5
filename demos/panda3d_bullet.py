"""Drop rigid crates of Bullet onto a soft block in Panda3D. If a file name is passed, only write an image."""

import sys

import numpy as np
from direct.showbase.ShowBase import ShowBase
from panda3d import bullet, core

from engine_adapter import EngineAdapter, FixedStep
from taichi_soft import BoxShape, Material, World, box

DT, EDGE, PICTURE = 1 / 60, 0.4, sys.argv[1:]
core.load_prc_file_data("", "audio-library-name null\nbackground-color 0.8 0.85 0.9")
core.load_prc_file_data("", "window-type offscreen\nload-display p3tinydisplay" if PICTURE else "")
game, rigid, soft, crates, last = ShowBase(), bullet.BulletWorld(), World(), [], np.zeros((3, 2, 3))
rigid.set_gravity(core.LVector3(0, 0, -9.81))
jelly = Material(young=6e4, poisson=0.4, density=1000, damping_ratio=0.1)
block = soft.add_body(box((1.6, 1.6, 0.7), (8, 8, 4)), jelly, position=(0, 0, 0.36))
for number in range(3):
    crate = game.render.attach_new_node(bullet.BulletRigidBodyNode("crate"))
    crate.set_pos(0.5 * number - 0.5, 0, 1.3 + 0.5 * number)
    crate.node().set_mass(40.0)
    crate.node().add_shape(bullet.BulletBoxShape(core.LVector3(EDGE / 2)))
    rigid.attach(crate.node())
    look = game.loader.load_model("models/box").copy_to(crate)
    look.set_texture_off(1)
    look.set_pos_hpr_scale(*(-EDGE / 2,) * 3, 0, 0, 0, *(EDGE,) * 3)
    crates.append((crate, soft.add_collider(BoxShape((EDGE,) * 3), position=tuple(crate.get_pos()))))
soft.build()


def step_bullet(soft):
    """Apply the impulses of the last soft step to the crates, step Bullet, and move the colliders to the
    crates. See docs/coupling.md.
    """
    now = np.array([(collider.impulse, collider.angular_impulse) for _, collider in crates])
    for (crate, _), (impulse, angular) in zip(crates, 1.5 * now - 0.5 * last, strict=True):
        crate.node().set_active(True)
        crate.node().apply_central_impulse(core.LVector3(*impulse))
        crate.node().apply_torque_impulse(core.LVector3(*angular))
    last[:] = now
    rigid.do_physics(DT, 0)  # with substeps, Bullet would report poses one step late
    for crate, collider in crates:
        collider.move_to(tuple(crate.get_pos()), tuple(np.roll(crate.get_quat(), -1)))


adapter, skin = EngineAdapter(soft, FixedStep(dt=DT), before_step=step_bullet), block.render_mesh(crease=50.0)
vertices, normals = np.empty((2, skin.vertex_count, 3), np.float32)
data = core.GeomVertexData("soft", core.GeomVertexFormat.get_v3n3(), core.Geom.UH_dynamic)
data.set_num_rows(skin.vertex_count)
triangles, geom, node = core.GeomTriangles(core.Geom.UH_static), core.Geom(data), core.GeomNode("soft")
for corners in skin.triangles.tolist():
    triangles.add_vertices(*corners)
geom.add_primitive(triangles)
node.add_geom(geom)
game.render.attach_new_node(node).set_color(0.95, 0.45, 0.35, 1)
game.disable_mouse()
game.camera.set_pos_hpr(1.6, -3.9, 2.4, 22, -23, 0)
sun, sky = core.DirectionalLight("sun"), core.AmbientLight("sky")
sun.direction, sky.color = core.LVector3(0.5, 0.8, -1.2), (0.15, 0.15, 0.2, 1)
for light in (sun, sky):
    game.render.set_light(game.render.attach_new_node(light))


def draw(task):
    """Advance the world by a frame, and write positions and normals into Panda3D's buffer."""
    adapter.advance(DT if PICTURE else game.clock.dt)
    adapter.render_mesh(skin, vertices, normals)
    memoryview(data.modify_array(0)).cast("B")[:] = np.hstack((vertices, normals)).tobytes()
    return task.cont


game.task_mgr.add(draw, "soft")
for _ in range(40 if PICTURE else 0):
    game.task_mgr.step()
game.win.save_screenshot(*PICTURE) if PICTURE else game.run()
