"""A cloth falls over a ball that moves back and forth, and friction carries it along.

The cloth hangs in folds around the ball. Its corners keep swinging when the ball reverses.
"""

import numpy as np
from numpy.typing import NDArray

from engine_adapter import FixedStep
from taichi_soft import Collider, SphereShape, SpringMaterial, World, cloth, cloth_constants
from taichi_soft.cli import main
from taichi_soft.render import PALETTE, Camera
from taichi_soft.render.film import Actor, Stage

CELLS = (32, 32)
SIDE, MASS, SKIN = 2.4, 0.6, 0.02  # side [m], mass [kg] and thickness [m] of the cloth
RADIUS, HEIGHT = 0.55, 1.15  # radius of the ball, and height of its centre [m]
REACH, PERIOD, BEGIN = (
    0.5,
    3.0,
    1.2,
)  # amplitude [m], period and start time [s] of the ball's motion
FALL = 0.35  # initial distance from the cloth to the ball [m]
STEP = FixedStep(dt=1 / 60, substeps=2)


class Mover:
    """Moves the ball before every step."""

    def __init__(self, ball: Collider) -> None:
        """Start with the ball in the centre."""
        self.ball = ball

    def __call__(self, world: World) -> None:
        """Move the ball to its position at the end of the next step."""
        self.ball.move_to(_place(world.time + STEP.dt))


def _place(time: float) -> NDArray[np.float64]:
    """Return the position of the ball's centre at a time, (3,) [m]. The motion starts smoothly."""
    since = max(time - BEGIN, 0.0)
    sway = REACH * min(since / PERIOD, 1.0) * np.sin(2.0 * np.pi * since / PERIOD)
    return np.array([sway, 0.0, HEIGHT])


def stage() -> Stage:
    """Make the stage: a horizontal cloth above the ball."""
    world = World(integrator="implicit_euler")
    ball = world.add_collider(SphereShape(RADIUS), position=_place(0.0), friction=0.6, thickness=SKIN)
    mesh = cloth((SIDE, SIDE), CELLS, MASS)
    material = SpringMaterial(
        cloth_constants(mesh, CELLS, tensile=400.0, shear=100.0, bend=1.0), damping=0.05
    )
    place = (0.1, 0.0, HEIGHT + RADIUS + FALL)  # slightly off centre
    body = world.add_body(mesh, material, law="springs", position=place)
    world.build()
    camera = Camera.framing(
        (-1.2, -0.8, 0.2), (1.2, 0.8, 2.2), aspect=16 / 9, azimuth=-70, elevation=12, margin=1.0
    )
    return Stage(
        "cloth over a moving ball",
        world,
        [Actor(body, PALETTE[2], look="cloth")],
        camera,
        STEP,
        8.0,
        act=Mover(ball),
        collider_colors={ball: PALETTE[1]},
    )


def proof(stage: Stage) -> float:
    """Return the smallest distance of a cloth vertex from the ball [m]; negative if a vertex is inside it."""
    mover = stage.act
    assert isinstance(mover, Mover)
    away = stage.actors[0].body.positions() - mover.ball.position
    return float(np.linalg.norm(away, axis=1).min()) - RADIUS


if __name__ == "__main__":
    main("demo", "drape")
