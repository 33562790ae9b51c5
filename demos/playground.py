"""Soft bodies tumble through fixed and moving colliders of all kinds, and end in a hollow.

Bodies squeeze between rods, paddles and each other, and recover their shapes afterwards.
"""

import numpy as np
import trimesh
from numpy.typing import NDArray

from engine_adapter import FixedStep
from taichi_soft import (
    BoxShape,
    CapsuleShape,
    HeightFieldShape,
    Material,
    MeshShape,
    SphereShape,
    World,
    box,
    cylinder,
    sphere,
    torus,
)
from taichi_soft.cli import main
from taichi_soft.render import PALETTE, Camera
from taichi_soft.render.film import Actor, Stage

MATERIAL = Material(young=8.0e4, poisson=0.3, density=400.0, damping_ratio=0.3)
LAYERS, ROWS, COLUMNS = 2, 2, 4  # layers, rows and columns of bodies above the ramp
SLOPE = 0.32  # slope of the ramp [rad]
HUB = np.array([1.85, 0.0, 3.6])  # centre of the wheel [m]
HOLLOW = np.array([1.7, 0.0, 0.0])  # centre of the hollow [m]
UP = np.array([0.0, 0.0, 1.0])
RIM = 2.4  # radius of the hollow's rim [m]
GROUND, MOVING = (0.52, 0.52, 0.40), (0.92, 0.90, 0.85)  # colours of the ground and of moving colliders
STEP = FixedStep(dt=1 / 50)


class Course:
    """Adds all colliders, and moves the wheel and the vertically moving bars before every step."""

    def __init__(self, world: World) -> None:
        """Add all colliders."""
        top, tilt = np.array([-1.4, 0.0, 4.85]), _turn(SLOPE)
        world.add_collider(BoxShape((3.6, 2.4, 0.14)), position=top, rotation=tilt, friction=0.1)
        for side in (-1.2, 1.2):
            place = top + tilt @ (0.0, side, 0.15)
            world.add_collider(CapsuleShape(0.14, 3.6), position=place, rotation=_turn(SLOPE + np.pi / 2))
        self.paddles = [world.add_collider(BoxShape((1.2, 2.4, 0.24)), position=HUB) for _ in range(2)]
        world.add_collider(MeshShape(_funnel()), position=HOLLOW + 1.75 * UP, friction=0.1)
        lying = _turn(0.0, about_x=np.pi / 2)
        self.bars = [world.add_collider(CapsuleShape(0.13, 2.4), rotation=lying) for _ in range(2)]
        world.add_collider(SphereShape(0.45), position=HOLLOW + 0.25 * UP)
        ground = world.add_collider(HeightFieldShape(_ground(), spacing=0.2), position=HOLLOW)
        self.colors = {ground: GROUND, **dict.fromkeys([*self.paddles, *self.bars], MOVING)}
        for i, bar in enumerate(self.bars):
            bar.teleport(self._bar(i, 0.0))

    def __call__(self, world: World) -> None:
        """Move the colliders to their poses at the end of the next step."""
        time = world.time + STEP.dt
        for i, paddle in enumerate(self.paddles):
            paddle.move_to(HUB, _turn(1.1 * time + i * np.pi / 2))
        for i, bar in enumerate(self.bars):
            bar.move_to(self._bar(i, time))

    def _bar(self, number: int, time: float) -> NDArray[np.float64]:
        side = 2 * number - 1
        return HOLLOW + np.array([0.75 * side, 0.0, 1.2 + 0.2 * side * np.sin(2.0 * time)])


def _turn(about_y: float, about_x: float = 0.0) -> NDArray[np.float64]:
    """Return the matrix (3, 3) that rotates first about x, then about y [rad]. The rotation about y turns the
    x axis towards -z.
    """
    c, s, k, w = np.cos(about_y), np.sin(about_y), np.cos(about_x), np.sin(about_x)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ np.array([[1, 0, 0], [0, k, -w], [0, w, k]])


def _funnel() -> trimesh.Trimesh:
    """Make a conical funnel with a hole and a wall of 16 cm."""
    inner = np.array([(0.78, 0.0), (0.85, 0.15), (2.85, 1.55)])
    outer = inner + np.array([0.13, -0.1])
    return trimesh.creation.revolve(np.concatenate([outer, inner[::-1], outer[:1]]), sections=64)


def _ground() -> NDArray[np.float64]:
    """Return heights on a square grid with a side of 6.8 m: a ring-shaped wall around a hollow."""
    x, y = np.meshgrid(*2 * [np.linspace(-3.4, 3.4, 35)], indexing="ij")
    away = (np.hypot(x, y) - RIM) / 0.6
    return np.asarray(0.03 + 1.0 * np.exp(-(away**2)))


def stage() -> Stage:
    """Make the stage: a block of bodies above the ramp."""
    shapes = [
        sphere(0.34, 3),
        box((0.56, 0.56, 0.56), (4, 4, 4)),
        cylinder(0.32, 0.56, rings=2, layers=4),
        torus(0.33, 0.15, rings=1, segments=18),
    ]
    world = World()
    course = Course(world)
    actors = []
    for i in range(LAYERS * ROWS * COLUMNS):
        column, (layer, row) = i % COLUMNS, divmod(i // COLUMNS, ROWS)
        place = (-2.7 + 0.8 * column, 0.45 - 0.9 * row, 5.95 + 0.8 * layer - 0.3 * column)
        mesh = shapes[(column + row + layer) % len(shapes)]
        body = world.add_body(mesh, MATERIAL, law="neo_hookean", position=place)
        actors.append(Actor(body, PALETTE[i % len(PALETTE)]))
    world.build()
    camera = Camera.framing(
        (-4.0, -2.4, 0.0), (3.9, 2.0, 8.4), aspect=16 / 9, azimuth=-74, elevation=20, margin=1.0
    )
    return Stage(
        "a course of colliders",
        world,
        actors,
        camera,
        STEP,
        8.0,
        act=course,
        collider_colors=course.colors,
        backdrop="meadow",
    )


def proof(stage: Stage) -> float:
    """Return the number of bodies in the hollow that do not penetrate the ground."""
    inside = 0
    for actor in stage.actors:
        rows = actor.body.positions()
        inside += np.hypot(*(rows - HOLLOW).T[:2]).max() < RIM + 0.3 and 0.0 < rows[:, 2].min() < 1.5
    return float(inside)


if __name__ == "__main__":
    main("demo", "playground")
