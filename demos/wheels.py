"""Soft wheels with motors at their hubs climb steps and brake at the top.

The softest wheel has a large contact area and folds around the edge of each step. The stiffest wheel rolls
over the edges.
"""

import numpy as np
from numpy.typing import NDArray

from engine_adapter import FixedStep
from taichi_soft import Body, BoxShape, Contact, Material, Motor, World, cylinder
from taichi_soft.cli import main
from taichi_soft.render import PALETTE, Camera
from taichi_soft.render.colors import Color
from taichi_soft.render.film import Actor, Stage
from taichi_soft.render.stage import Paint

STIFFNESSES = (1.6e4, 4e4, 4e5)  # Young's moduli of the wheels, softest first [Pa]
RADIUS, WIDTH, HUB = 0.5, 0.7, 0.2  # radius and width of the wheels; radius of the driven hub [m]
SPEED, TORQUE = 3.0, 1500.0  # speed [rad/s] and largest torque [N m] of the motors
LANE, ASIDE = 1.4, 0.3  # distance between wheels, and additional width of the steps on each side [m]
RISE, TREAD, STEPS = 0.14, 0.9, 3  # height and depth of the steps [m], and their number
FOOT, TOP = 1.4, 2.8  # start of the first step, and length of the last step [m]
GOAL = FOOT + (STEPS - 1) * TREAD + TOP / 2 - 0.2  # position at which the motors brake [m]
BEGIN = 0.4  # start time of the motors [s]
DRAG = 2.0  # damping rate of a braking wheel [1/s]; without it, the wheel would rock about its hub
SMOOTHING = 0.04  # weight of the last step in the displayed torques
STEP = FixedStep(dt=1 / 50)


class Drivers:
    """Starts all motors, and brakes each one at the top."""

    def __init__(self, motors: list[Motor]) -> None:
        """Start with all motors waiting."""
        self.motors = motors
        self.torques = np.zeros(len(motors))  # running mean of each motor's torque [N m]

    def __call__(self, world: World) -> None:
        """Update the motors before a step."""
        self.torques += SMOOTHING * ([motor.effort for motor in self.motors] - self.torques)
        for motor in self.motors:
            is_there = motor.body.center_of_mass()[0] > GOAL
            speed = SPEED if world.time >= BEGIN and not is_there else 0.0
            if motor.speed != speed:
                motor.set_speed(speed)
                motor.body.set_linear_damping(DRAG if is_there else 0.0)

    def caption(self) -> str:
        """Return the torques as text for a frame."""
        return "torque " + "  ".join(f"{10 * round(t / 10):5.0f}" for t in self.torques) + " N m"


def stage() -> Stage:
    """Make the stage: wheels side by side in front of the steps."""
    world = World()
    width = LANE * len(STIFFNESSES) + 2 * ASIDE
    for i in range(STEPS):
        length = TREAD if i < STEPS - 1 else TOP
        size = (length, width, RISE * (i + 1))
        middle = FOOT + i * TREAD + length / 2
        world.add_collider(BoxShape(size), position=(middle, 0.0, size[2] / 2), friction=0.9)
    mesh = cylinder(RADIUS, WIDTH, rings=4, layers=5)
    upright = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # wheel axis along y
    actors = []
    for i, young in enumerate(STIFFNESSES):
        body = world.add_body(
            mesh,
            Material(young, 0.3, 400.0, damping_ratio=0.2),
            position=(0.0, LANE * (i - 1), RADIUS + 0.01),
            rotation=upright,
            contact=Contact(friction=0.9),
        )
        actors.append(Actor(body, paint=_sectors(PALETTE[i])))
    world.build()
    hub = np.flatnonzero(np.hypot(*mesh.vertices[:, :2].T) < HUB)
    motors = [
        world.add_motor(body, hub, (0.0, 1.0, 0.0), speed=0.0, max_torque=TORQUE) for body in world.bodies
    ]
    for body in world.bodies:  # keeps wheels straight despite asymmetric meshes
        world.add_motor(body, hub, (0.0, 0.0, 1.0), speed=0.0, max_torque=TORQUE, is_fixed=True)
    drivers = Drivers(motors)
    camera = Camera.framing(
        (-0.5, -2.2, 0.0), (5.8, 1.8, 1.9), aspect=16 / 9, azimuth=-106, elevation=20, margin=1.0
    )
    legend = [(PALETTE[i], f"E = {young / 1e3:.0f} kPa") for i, young in enumerate(STIFFNESSES)]
    found = Stage("wheels driven at their hubs", world, actors, camera, STEP, 7.0, act=drivers)
    found.caption, found.legend, found.backdrop = drivers.caption, legend, "dusk"
    return found


def _sectors(color: Color) -> Paint:
    """Return a function that paints every other twelfth of a wheel paler, to show its rotation."""

    def paint(body: Body) -> NDArray[np.float32]:
        x, y, _ = body.mesh.vertices.T
        is_pale = np.floor(np.arctan2(y, x) / (np.pi / 6)).astype(int) % 2 == 0
        pale = 0.5 * np.array(color) + 0.5
        return np.where(is_pale[:, None], pale, color).astype(np.float32)

    return paint


def proof(stage: Stage) -> float:
    """Return the number of wheels on the last step."""
    height = STEPS * RISE
    begin = FOOT + (STEPS - 1) * TREAD
    places = [actor.body.center_of_mass() for actor in stage.actors]
    return float(sum(begin < x < begin + TOP and z > height + 0.5 * RADIUS for x, _, z in places))


if __name__ == "__main__":
    main("demo", "wheels")
