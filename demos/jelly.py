"""A ball drops onto a stack of jelly blocks, which compress, wobble, and carry the ball.

The top block deforms first, and bulges. The impact then travels down through the lower blocks, and the stack
pushes the ball up again.
"""

import numpy as np

from engine_adapter import FixedStep
from taichi_soft import Contact, Material, World, box, sphere
from taichi_soft.cli import main
from taichi_soft.core.constants import GRAVITY_EARTH
from taichi_soft.render import PALETTE, Camera
from taichi_soft.render.film import Actor, Stage

JELLY = Material(young=2.5e4, poisson=0.4, density=500.0, damping_ratio=0.08)
RUBBER = Material(young=4.0e5, poisson=0.3, density=1300.0, damping_ratio=0.3)
SIZE, LAYERS = (1.8, 1.8, 0.5), 3  # size of a block [m], and number of blocks
SKIN = 0.02  # distance between blocks [m]
RADIUS, DROP = 0.5, 0.9  # radius of the ball, and initial height of the ball above the stack [m]
TURN = 0.12  # rotation of each block relative to the block below [rad]
STEP = FixedStep(dt=1 / 50)


class Scale:
    """Records the load on the floor and the compression of the stack."""

    def __init__(self) -> None:
        """Start with no recorded loads."""
        self.loads: list[float] = []  # load on the floor in each step [N]
        self.lowest = np.inf  # lowest height of the stack's top [m]

    def __call__(self, world: World) -> None:
        """Record the load and the height of the stack after the last step."""
        if world.step_count:
            assert world.floor_collider is not None
            self.loads.append(-float(world.floor_collider.impulse[2]) / STEP.dt)
        top = world.bodies[LAYERS - 1]
        self.lowest = min(self.lowest, float(top.positions()[:, 2].mean()))


def stage() -> Stage:
    """Make the stage: an undeformed stack of blocks, and the ball above it."""
    world = World(friction=0.8)
    contact = Contact(friction=0.8, thickness=SKIN)
    block = box(SIZE, (7, 7, 3))
    block = block.translated(-np.mean(block.bounds, axis=0))
    for i in range(LAYERS):
        height = SIZE[2] / 2 + 0.01 + i * (SIZE[2] + SKIN)
        c, s = np.cos(i * TURN), np.sin(i * TURN)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        world.add_body(block, JELLY, position=(0.0, 0.0, height), rotation=turn, contact=contact)
    top = LAYERS * (SIZE[2] + SKIN) + DROP + RADIUS
    world.add_body(sphere(RADIUS, 4), RUBBER, position=(0.0, 0.0, top), contact=contact)
    world.build()
    colors = [PALETTE[5], PALETTE[2], PALETTE[4], PALETTE[1]]
    actors = [
        Actor(body, color, look="jelly" if i < LAYERS else "matte")
        for i, (body, color) in enumerate(zip(world.bodies, colors, strict=True))
    ]
    seen = (-1.15, -1.15, 0.0), (1.15, 1.15, 3.2)
    camera = Camera.framing(*seen, aspect=16 / 9, azimuth=-62, elevation=9, margin=1.02)
    title = f"jelly, E = {JELLY.young / 1e3:g} kPa"
    return Stage(title, world, actors, camera, STEP, 5.0, act=Scale())


def proof(stage: Stage) -> float:
    """Return the mean load on the floor in the last second, divided by the total weight."""
    scale = stage.act
    assert isinstance(scale, Scale)
    weight = sum(float(body.masses.sum()) for body in stage.world.bodies) * GRAVITY_EARTH
    return float(np.mean(scale.loads[-round(1.0 / STEP.dt) :])) / weight


if __name__ == "__main__":
    main("demo", "jelly")
