"""A soft bar hangs from a swinging plate. The game moves the plate and reads the load on the plate.

The bar is longest at the lowest point of each swing, where the load is largest. At both ends of the swing,
the load is smaller than the weight of the bar.
"""

import numpy as np
from numpy.typing import NDArray

from engine_adapter import FixedStep
from taichi_soft import Attachment, Body, BoxShape, CapsuleShape, Frame, Material, World, box
from taichi_soft.cli import main
from taichi_soft.core.constants import GRAVITY_EARTH
from taichi_soft.render import Camera, ColorScale
from taichi_soft.render.film import Actor, Stage
from taichi_soft.render.props import Prop

MATERIAL = Material(young=2.0e5, poisson=0.3, density=1000.0, damping_ratio=0.2)
SIZE = (0.5, 0.5, 1.4)  # edges of the bar [m]
PIVOT = np.array([0.0, 0.0, 3.8])  # position of the pendulum's pivot [m]
ROD = 1.8  # distance from the pivot to the plate [m]
LENGTH = ROD + SIZE[2] / 2  # distance from the pivot to the centre of the bar [m]
WIDEST = np.radians(50.0)
STRESS = ColorScale("von Mises stress", 0.0, 3.0e4, "Pa")
STEP = FixedStep(dt=1 / 50)


class Swing:
    """Moves the plate as a pendulum in every step, and records the load along the rod."""

    def __init__(self, frame: Frame, hold: Attachment) -> None:
        """Start the pendulum at rest, at its largest angle."""
        self.frame, self.hold = frame, hold
        self.angle, self.speed = WIDEST, 0.0  # [rad], [rad/s]
        self.loads: list[float] = []  # load along the rod in each step [N]

    def __call__(self, world: World) -> None:
        """Move the plate before a step."""
        if world.step_count:
            self.loads.append(self.load())
        for _ in range(100):
            self.speed -= STEP.dt / 100 * GRAVITY_EARTH / LENGTH * np.sin(self.angle)
            self.angle += STEP.dt / 100 * self.speed
        axes = _turn(self.angle)
        self.frame.move_to(PIVOT - ROD * axes[:, 2], axes)

    def load(self) -> float:
        """Return the load on the plate in the last step, along the rod [N]."""
        return float(-self.hold.force @ self.frame.rotation[:, 2])

    def caption(self) -> str:
        """Return the load and the weight as text for a frame."""
        weight = float(self.hold.body.masses.sum()) * GRAVITY_EARTH
        return f"load {self.load() / 1e3:.1f} kN, weight {weight / 1e3:.1f} kN"


def stage() -> Stage:
    """Make the stage: an unstretched bar on a pendulum, at its largest angle."""
    mesh = box(SIZE, (4, 4, 11))
    start = _turn(WIDEST)
    world = World()
    body = world.add_body(mesh, MATERIAL, rotation=start, position=PIVOT - LENGTH * start[:, 2])
    world.build()
    frame = world.add_frame(PIVOT - ROD * start[:, 2], start)
    top = np.flatnonzero(mesh.vertices[:, 2] > SIZE[2] / 2 - 1e-6)
    swing = Swing(frame, body.attach(top, frame, two_way=True))
    plate, rod = BoxShape((0.6, 0.6, 0.08)).surface(), CapsuleShape(0.05, ROD).surface()
    props = [
        Prop((plate[0] + (0, 0, 0.04), plate[1]), frame),
        Prop((rod[0] + (0, 0, ROD / 2), rod[1]), frame),
    ]
    camera = Camera.framing((-2.3, -0.3, 0.2), (2.3, 0.3, 4.6), aspect=16 / 9, azimuth=-80, elevation=5)
    actors = [Actor(body, paint=_stress)]
    found = Stage("hung from a frame", world, actors, camera, STEP, 8.0, act=swing, props=props)
    found.caption, found.scale = swing.caption, STRESS
    return found


def _turn(angle: float) -> NDArray[np.float64]:
    """Return the rotation (3, 3) about y that swings the bar towards -x by `angle` [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def _stress(body: Body) -> NDArray[np.float32]:
    return STRESS.colors(body.vertex_stress())


def proof(stage: Stage) -> float:
    """Return the mean load along the rod in the last full swing, divided by the weight of the bar."""
    swing = stage.act
    assert isinstance(swing, Swing)
    weight = float(swing.hold.body.masses.sum()) * GRAVITY_EARTH
    steps = round(period() / STEP.dt)
    return float(np.mean(swing.loads[-steps:])) / weight


def period() -> float:
    """Return the period of the swing [s], computed with Legendre's arithmetic-geometric mean."""
    a, b = 1.0, float(np.cos(WIDEST / 2))
    while a - b > 1e-12:
        a, b = (a + b) / 2, float(np.sqrt(a * b))
    return 2 * np.pi / a * float(np.sqrt(LENGTH / GRAVITY_EARTH))


if __name__ == "__main__":
    main("demo", "attach")
