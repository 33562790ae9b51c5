"""Three puddings wobble on a jerked tray. Each pudding has its requested sag, frequency and settling time.

After the same jerk, the left pudding shivers briefly, and the right pudding sways for seconds.
"""

import numpy as np
import trimesh

from engine_adapter import FixedStep
from taichi_soft import BoxShape, Collider, Contact, Feel, Material, SoftBodyAsset, World, material_from_feel
from taichi_soft.cli import main
from taichi_soft.render import PALETTE, Camera
from taichi_soft.render.film import Actor, Stage

WISHES = (
    {"sag": 0.010, "wobble_hz": 12.0, "settle_s": 0.4},
    {"sag": 0.030, "wobble_hz": 7.0, "settle_s": 1.0},
    {"sag": 0.055, "wobble_hz": 4.0, "settle_s": 3.0},
)
"""Requests for each pudding: sag as a fraction of the height, frequency in free flight [Hz], settling time
[s]."""

PROFILE = ((0.0, 0.0), (0.50, 0.0), (0.52, 0.05), (0.40, 0.45), (0.36, 0.52), (0.28, 0.55), (0.0, 0.55))
"""Radius and height of each corner of a pudding's profile [m]."""

CELLS, DENSITY, POISSON = 9, 300.0, 0.4
SPACE = 1.5  # distance between the centres of puddings [m]
TRAY = (4.6, 1.5, 0.1)  # length, width, thickness [m]
JERK_AT, JERK, JERK_TIME = 0.5, 0.12, 0.12  # time, distance and duration of the jerk [s, m, s]
STEP = FixedStep(dt=1 / 100)


def stage() -> Stage:
    """Make the stage: puddings on the tray, each with a material that meets its request."""
    pudding = trimesh.creation.revolve(np.array(PROFILE), sections=64)
    plain = Material(1e5, POISSON, DENSITY)
    cage = SoftBodyAsset.from_surface(pudding, plain, cells=CELLS)
    feels = [material_from_feel(cage.mesh, **wish, poisson=POISSON, density=DENSITY) for wish in WISHES]
    world = World(soft_contact=False, sleep_speed=0.0)
    tray = world.add_collider(BoxShape(TRAY), position=(0, 0, TRAY[2] / 2 + 0.2), friction=1.0)
    contact = Contact(friction=1.0)
    for i, feel in enumerate(feels):
        asset = SoftBodyAsset(cage.mesh, feel.material, skin=cage.skin, contact=contact)
        world.add_body(asset, position=(SPACE * (i - 1), 0, TRAY[2] + 0.205))
    world.build()
    for body, feel in zip(world.bodies, feels, strict=True):
        body.set_gravity_scale(feel.gravity_scale)

    colors = [PALETTE[i] for i in (0, 4, 2)]
    actors = [Actor(body, color, look="jelly") for body, color in zip(world.bodies, colors, strict=True)]
    legend = [
        (color, f"{wish['wobble_hz']:g} Hz, still after {wish['settle_s']:g} s")
        for color, wish in zip(colors, WISHES, strict=True)
    ]
    camera = Camera.framing((-2.2, -0.7, 0.2), (2.2, 0.7, 1.0), aspect=16 / 9, azimuth=-75, elevation=14)
    return Stage("as requested", world, actors, camera, STEP, 5.0, act=Jerk(tray, feels), legend=legend)


class Jerk:
    """Moves the tray forwards and back, and stores the materials of the puddings."""

    def __init__(self, tray: Collider, feels: list[Feel]) -> None:
        self.tray, self.feels = tray, feels

    def __call__(self, world: World) -> None:
        since, speed = world.time - JERK_AT, 0.0
        if 0.0 <= since < 2.0 * JERK_TIME:
            speed = JERK / JERK_TIME * (1.0 if since < JERK_TIME else -1.0)
        self.tray.set_velocity((0.0, speed, 0.0))


def proof(stage: Stage) -> float:
    """Return the largest relative deviation from a request."""
    assert isinstance(stage.act, Jerk)
    misses = [
        abs(getattr(feel.simulated, name) / wish - 1)
        for feel, wishes in zip(stage.act.feels, WISHES, strict=True)
        for name, wish in wishes.items()
    ]
    return max(misses)


if __name__ == "__main__":
    main("demo", "feel")
