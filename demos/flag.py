"""A flag flutters on a pole in a wind that turns and gusts.

The cloth has the weight and thickness of nylon. Waves run from the pole to the free edge, and grow on their
way. When the wind drops, the flag falls against the pole and hangs in folds.
"""

import numpy as np

from engine_adapter import FixedStep
from taichi_soft import CapsuleShape, Contact, ShellMaterial, World, sheet
from taichi_soft.cli import main
from taichi_soft.render import PALETTE, Camera
from taichi_soft.render.film import Actor, Stage

NYLON = ShellMaterial(
    young=4e6, poisson=0.3, density=1100.0, thickness=2e-4, damping=0.005, bending_damping=2e-3
)
SIZE, CELLS = (1.5, 0.9), (30, 18)  # length and height of the flag [m], and cells
POLE, TOP = 0.03, 2.6  # radius of the pole, and height of the flag's upper edge [m]
GUST = 9.0  # largest speed of the wind [m/s]
PERIOD, DROP = 1.7, 5.0  # period of the gusts, and time at which the wind drops [s]
STEP = FixedStep(dt=1 / 60)


class Weather:
    """Turns the wind, and records how far the flag reached and stretched."""

    def __init__(self) -> None:
        """Start without records."""
        self.farthest = 0.0  # largest distance of a vertex from the pole [m]
        self.longest = 1.0  # largest ratio of an edge's length to its rest length

    def __call__(self, world: World) -> None:
        """Set the wind of the next step."""
        t = world.time
        speed = GUST * (0.75 + 0.25 * np.sin(2 * np.pi * t / PERIOD)) * min(t, 1.0) if t < DROP else 0.0
        angle = 0.35 * np.sin(1.3 * t) + 0.2 * np.sin(4.1 * t)
        up = 0.4 * np.sin(2.3 * t)
        world.set_wind((speed * np.cos(angle), speed * np.sin(angle), speed * up))
        flag = world.bodies[0]
        x, edges = flag.positions(), flag.mesh.edges
        self.farthest = max(self.farthest, float(np.linalg.norm(x[:, :2], axis=1).max()))
        lengths = np.linalg.norm(x[edges[:, 1]] - x[edges[:, 0]], axis=1) / flag.mesh.edge_lengths
        self.longest = max(self.longest, float(lengths.max()))


def stage() -> Stage:
    """Make the stage: a flag along x, attached to a pole at its left edge."""
    world = World(floor=0.0)
    pole = world.add_collider(CapsuleShape(POLE, 3.0), position=(-POLE - 0.01, 0.0, 1.4), friction=0.3)
    upright = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    mesh = sheet(SIZE, CELLS)
    hoist = np.flatnonzero(mesh.vertices[:, 0] < -SIZE[0] / 2 + 1e-6)
    flag = world.add_body(
        mesh,
        NYLON,
        position=(SIZE[0] / 2, 0.0, TOP - SIZE[1] / 2),
        rotation=upright,
        pinned=hoist,
        contact=Contact(itself=True, thickness=6e-3),
    )
    world.build()
    camera = Camera.framing(
        (-0.3, -0.6, 1.2), (1.5, 0.6, 2.7), aspect=16 / 9, azimuth=-68, elevation=4, margin=1.05
    )
    return Stage(
        f"nylon, {1e3 * float(NYLON.thickness):g} mm",
        world,
        [Actor(flag, PALETTE[1], look="cloth")],
        camera,
        STEP,
        8.0,
        act=Weather(),
        collider_colors={pole: PALETTE[5]},
    )


def proof(stage: Stage) -> float:
    """Return the largest stretch of an edge of the flag, as a fraction."""
    weather = stage.act
    assert isinstance(weather, Weather)
    return weather.longest - 1.0


if __name__ == "__main__":
    main("demo", "flag")
