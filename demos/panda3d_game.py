"""A small game in Panda3D: toys fall onto a moving platform, and Bullet's crates onto a soft block.

Mouse: grab soft bodies. Space: drop a toy. Arrows: rotate the camera. R: restart. D: debug lines. Escape:
quit. With `--headless A.png B.png C.png` the game plays automatically without a window, and writes images.
"""

import argparse
import math
import sys

import trimesh
from direct.gui.OnscreenText import OnscreenText
from direct.showbase.ShowBase import ShowBase
from panda3d import bullet, core

from engine_adapter import EngineAdapter, FixedStep
from engine_adapter import panda3d as soft
from taichi_soft import Contact, Material, SoftBodyAsset, World, box
from taichi_soft.core.package_data import ASSETS

DT, TOYS = 1 / 60, 6  # length of a step [s]; largest number of toys
EDGE, MASS = 0.5, 60.0  # edge [m] and mass [kg] of a crate
MIDDLE, SWING = -1.1, 0.4  # centre and amplitude of the platform's motion [m]
KEYS = "mouse: grab   space: drop a toy   arrows: rotate   R: restart   D: debug"


class Game(ShowBase):
    """The game: its level, the motion of the platform, and the controls."""

    def __init__(self) -> None:
        super().__init__()
        self.disable_mouse()
        self.world, self.rigid = World(floor=None), bullet.BulletWorld()
        self.rigid.set_gravity(core.LVector3(0, 0, -9.81))
        self.coupling = soft.BulletCoupling(self.world, self.rigid)
        self.build_level()
        look, contact = (
            trimesh.load_scene(ASSETS / "elephant.glb", process=False),
            Contact(0.8, thickness=0.01),
        )
        cloth = Material(young=3e4, poisson=0.4, density=200, damping_ratio=0.08)
        self.toy = SoftBodyAsset.from_surface(look, cloth, cells=7, up="y", contact=contact)
        self.world.reserve(self.toy, TOYS)
        jelly = Material(young=6e4, poisson=0.3, density=1000, damping_ratio=0.3)
        block = self.world.add_body(box((1.4, 1.4, 0.5), (10, 10, 4)), jelly, position=(1.1, 0, 0.26))
        self.world.build()
        self.world.warm_up()
        self.adapter = EngineAdapter(self.world, FixedStep(dt=DT), before_step=self.before_step)
        self.task, self.debug = soft.SoftBodyTask(self, self.adapter), soft.DebugNode(self.adapter)
        self.debug.hide()
        self.draw(self.debug)
        self.draw(soft.SoftBodyNode(self.adapter, block)).set_color(0.95, 0.45, 0.35, 1)
        self.hand, self.toys, self.angle = soft.MouseGrab(self, self.world), [], 0.0
        self.start = self.world.snapshot(), self.coupling.snapshot()
        self.begin()
        self.turn(0)
        keys = {"space": self.drop, "r": self.begin, "d": self.show_debug, "escape": sys.exit}
        for key, action in keys.items():
            self.accept(key, action)
        for key, degrees in {"arrow_left": -5, "arrow_right": 5}.items():
            self.accept(key, self.turn, [degrees])
            self.accept(f"{key}-repeat", self.turn, [degrees])
        OnscreenText(KEYS, pos=(0, -0.94), scale=0.06)

    def build_level(self) -> None:
        """Build the level: ground and crates in Bullet, the platform as a collision solid."""
        ground = self.add_rigid("ground", bullet.BulletPlaneShape(core.LVector3(0, 0, 1), 0), 0.0)
        soft.add_colliders(self.world, ground)
        self.add_look(ground, (14, 14, 0.1), (0.62, 0.68, 0.6, 1)).set_z(-0.1)
        self.platform = self.render.attach_new_node("platform")
        self.platform.set_pos(MIDDLE, 0, 0.3)
        solid = self.platform.attach_new_node(core.CollisionNode("solid"))
        solid.node().add_solid(core.CollisionBox(core.LPoint3(0), 0.8, 0.8, 0.1))
        self.movers = soft.add_colliders(self.world, self.platform, friction=0.9)
        self.add_look(self.platform, (1.6, 1.6, 0.2), (0.45, 0.55, 0.75, 1))
        for number in range(2):
            crate = self.add_rigid("crate", bullet.BulletBoxShape(core.LVector3(EDGE / 2)), MASS)
            crate.set_pos(0.8 + 0.6 * number, 0, 1.0 + 0.5 * number)
            self.add_look(crate, (EDGE, EDGE, EDGE), (0.75, 0.6, 0.4, 1))
            self.coupling.add(crate)
        sun, sky = core.DirectionalLight("sun"), core.AmbientLight("sky")
        sun.direction, sky.color = core.LVector3(0.4, 0.8, -1.2), (0.35, 0.35, 0.4, 1)
        for light in (sun, sky):
            self.render.set_light(self.render.attach_new_node(light))

    def add_rigid(self, name: str, shape: bullet.BulletShape, mass: float) -> core.NodePath:
        """Add a rigid body to Bullet, and return its node."""
        path = self.render.attach_new_node(bullet.BulletRigidBodyNode(name))
        path.node().add_shape(shape)
        path.node().set_mass(mass)
        self.rigid.attach(path.node())
        return path

    def add_look(self, path: core.NodePath, size: tuple, color: tuple) -> core.NodePath:
        """Add a visible box to a node, and return the box."""
        look = self.loader.load_model("models/box").copy_to(path)
        look.set_texture_off(1)
        look.set_color(color)
        look.set_pos_hpr_scale(*(-length / 2 for length in size), 0, 0, 0, *size)
        return look

    def draw(self, node: core.NodePath) -> core.NodePath:
        """Draw a node in every frame from now on, and return the node."""
        node.reparent_to(self.render)
        self.task.nodes.append(node)
        return node

    def before_step(self, world: World) -> None:
        """Move the platform and step Bullet, once per fixed step."""
        self.platform.set_x(MIDDLE + SWING * math.sin(world.time + DT))
        for mover in self.movers:
            mover.follow()
        self.coupling.step(DT)

    def drop(self) -> None:
        """Drop another toy onto the platform if fewer than `TOYS` exist."""
        if len(self.toys) < TOYS:
            place = self.platform.get_pos() + core.LVector3(0.3 * (len(self.toys) % 3 - 1), 0, 0.9)
            body = self.world.spawn(self.toy, position=tuple(place))
            self.toys.append(self.draw(soft.SoftBodyNode(self.adapter, body)))

    def begin(self) -> None:
        """Restore the initial state, and drop a first toy."""
        self.hand.release()
        self.adapter.restore(self.start[0])
        self.coupling.restore(self.start[1])
        for node in self.toys:
            self.task.nodes.remove(node)
            node.remove_node()
        self.toys.clear()
        self.drop()

    def show_debug(self) -> None:
        """Toggle the debug lines."""
        self.debug.show() if self.debug.is_hidden() else self.debug.hide()

    def turn(self, degrees: float) -> None:
        """Rotate the camera around the centre of the level."""
        self.angle += math.radians(degrees)
        self.camera.set_pos(6 * math.sin(self.angle), -6 * math.cos(self.angle), 2.6)
        self.camera.look_at(0, 0, 0.5)

    def play(self, pictures: list[str]) -> None:
        """Write up to three images, with 1 s of play before each.

        Before the first image, a toy falls. Before the second image, the toy is pulled up while another toy
        falls. The third image shows debug lines.
        """
        clock, spot = core.ClockObject.get_global_clock(), core.LPoint2()
        clock.mode, clock.dt = core.ClockObject.M_non_real_time, DT
        for number, picture in enumerate(pictures):
            if number == 1:
                self.messenger.send("space")
                toy = core.LPoint3(*self.toys[0].body.center_of_mass())
                self.camLens.project(self.cam.get_relative_point(self.render, toy), spot)
                self.hand.press(*spot)
            elif number == 2:
                self.messenger.send("d")
            for frame in range(60):
                if number == 1:
                    self.hand.move(spot.x, spot.y + 0.008 * frame)
                self.task_mgr.step()
            self.win.save_screenshot(core.Filename.from_os_specific(picture))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--headless", nargs="+", metavar="PNG", help="play without a window; images to write")
    PICTURES = parser.parse_args().headless
    core.load_prc_file_data("", "audio-library-name null\nbackground-color 0.8 0.85 0.9")
    core.load_prc_file_data("", "window-type offscreen\nload-display p3tinydisplay" if PICTURES else "")
    game = Game()
    game.play(PICTURES) if PICTURES else game.run()
