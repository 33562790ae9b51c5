"""A ball on a rope swings into a tower of soft blocks and knocks it over.

The ball dents the blocks that it hits. The tower then breaks in two, and its upper half topples.
"""

import numpy as np
from numpy.typing import NDArray

from engine_adapter import FixedStep
from taichi_soft import Collider, Contact, Frame, Material, SphereShape, World, box
from taichi_soft.cli import main
from taichi_soft.core.constants import GRAVITY_EARTH
from taichi_soft.render import PALETTE, Camera
from taichi_soft.render.film import Actor, Stage
from taichi_soft.render.props import Prop

RUBBER = Material(young=8.0e4, poisson=0.35, density=300.0, damping_ratio=0.2)
SIZE, LAYERS = (0.8, 0.8, 0.5), 7  # size of a block [m], and number of blocks
SKIN = 0.02  # distance between blocks [m]
RADIUS, ROPE = 0.45, 3.4  # radius of the ball, and length of the rope from its centre [m]
TOP = 5.2  # height of the rope's upper end [m]
WIDEST = np.radians(36.0)  # angle at which the ball is released
BEGIN = 0.5  # time of the release [s]
STEP = FixedStep(dt=1 / 50)


class Ball:
    """Swings the ball like a pendulum that the tower does not slow down."""

    def __init__(self, collider: Collider, rope: Frame) -> None:
        """Start with the ball displaced and held."""
        self.collider, self.rope = collider, rope
        self.angle, self.rate = -WIDEST, 0.0

    def __call__(self, world: World) -> None:
        """Move the ball and the rope before a step."""
        if world.time >= BEGIN:
            for _ in range(10):
                self.rate -= GRAVITY_EARTH / ROPE * np.sin(self.angle) * STEP.dt / 10
                self.angle += self.rate * STEP.dt / 10
        self.collider.move_to(*_pose(self.angle))
        self.rope.move_to(*_pose(self.angle))


def stage() -> Stage:
    """Make the stage: the tower, and the displaced ball."""
    world = World(friction=0.6, sleep_speed=0.0)
    contact = Contact(friction=0.6, thickness=SKIN)
    block = box(SIZE, (5, 5, 3))
    block = block.translated(-np.mean(block.bounds, axis=0))
    for i in range(LAYERS):
        height = SIZE[2] / 2 + 0.01 + i * (SIZE[2] + SKIN)
        world.add_body(block, RUBBER, position=(0.0, 0.0, height), contact=contact)
    position, rotation = _pose(-WIDEST)
    ball = world.add_collider(SphereShape(RADIUS), position=position, rotation=rotation, friction=0.4)
    world.build()
    rope = world.add_frame(position, rotation)
    colors = [PALETTE[i] for i in (3, 1, 4, 2, 0, 5, 6)]
    actors = [Actor(body, color) for body, color in zip(world.bodies, colors, strict=True)]
    camera = Camera.framing((-2.6, -1.0, 0.0), (3.4, 1.0, 3.9), aspect=16 / 9, azimuth=-72, elevation=7)
    return Stage(
        "a tower is knocked over",
        world,
        actors,
        camera,
        STEP,
        5.0,
        act=Ball(ball, rope),
        props=[Prop(_rope_surface(), rope)],
        backdrop="meadow",
    )


def _pose(angle: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the position [m] of the ball and the axes of ball and rope, for an angle of the rope [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    place = np.array([ROPE * s, 0.0, TOP - ROPE * c])
    return place, np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])


def _rope_surface() -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return the surface of a thin bar that extends upwards from the ball's centre."""
    rod = box((0.05, 0.05, ROPE), (1, 1, 1))
    return rod.vertices - np.mean(rod.bounds, axis=0) + (0.0, 0.0, ROPE / 2), rod.surface


def proof(stage: Stage) -> float:
    """Return the number of blocks that sank by more than half their height."""
    heights = [body.center_of_mass()[2] for body in stage.world.bodies]
    stood = [SIZE[2] / 2 + 0.01 + i * (SIZE[2] + SKIN) for i in range(LAYERS)]
    return float(np.sum(np.subtract(stood, heights) > SIZE[2] / 2))


if __name__ == "__main__":
    main("demo", "tower")
