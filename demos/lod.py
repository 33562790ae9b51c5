"""Soft balls roll down a chute towards the camera; closer balls have more tetrahedra.

A ball changes its colour with its level of detail. Its motion continues unchanged.
"""

import numpy as np
import trimesh
from numpy.typing import NDArray

from engine_adapter import FixedStep
from taichi_soft import Body, BoxShape, Contact, Material, SoftBodyAsset, World
from taichi_soft.cli import main
from taichi_soft.render import PALETTE, Camera
from taichi_soft.render.film import Actor, Stage

CELLS = (10, 6, 4)  # cells along a ball in each level, finest first
DISTANCES = (10.3, 13.8)  # distances from the camera above which the second and the third level are used [m]
HYSTERESIS = 0.5  # distance by which a ball must be below a limit to return to the finer level [m]
JELLY = Material(young=3.0e4, poisson=0.4, density=200.0)
RADIUS, COUNT = 0.5, 5
SLOPE, LENGTH, WIDTH = 0.22, 14.0, 6.6  # slope [rad], length and width [m] of the chute
COLORS = tuple(PALETTE[i] for i in (0, 2, 3))  # colours of the levels
STEP = FixedStep(dt=1 / 50)


def stage() -> Stage:
    """Make the stage: balls above the upper end of a chute with a wall at its lower end."""
    ball = trimesh.creation.icosphere(subdivisions=4, radius=RADIUS)
    asset = SoftBodyAsset.from_surface(ball, JELLY, cells=CELLS, contact=Contact(friction=0.8))
    world = World(friction=0.8, soft_contact=False)
    turn = (np.sin(SLOPE / 2), 0.0, 0.0, np.cos(SLOPE / 2))
    middle = 0.5 * LENGTH * np.array([0.0, np.cos(SLOPE), np.sin(SLOPE)])
    world.add_collider(BoxShape((WIDTH, LENGTH, 0.2)), position=middle, rotation=turn, friction=0.8)
    world.add_collider(BoxShape((WIDTH, 0.2, 1.0)), position=(0.0, 0.3, 0.5))
    for i in range(COUNT):
        y = LENGTH - 1.0 - 0.7 * ((3 * i) % COUNT)
        place = (1.2 * (i - (COUNT - 1) / 2), y, y * np.tan(SLOPE) + 1.3)
        world.add_body(asset, position=place, velocity=(0.0, -2.5, 0.0))
    world.build()
    camera = Camera(eye=(0.0, -7.0, 5.6), target=(0.0, 4.6, 2.75), fov_degrees=43.0)
    choice = Choice(np.asarray(camera.eye))
    choice(world)

    def caption() -> str:
        now = sum(len(body.tets) for body in world.bodies)
        return f"{now:,} of {COUNT * len(asset.mesh.tets):,} tetrahedra"

    actors = [Actor(body, paint=paint) for body in world.bodies]
    legend = [(color, f"{cells} cells") for color, cells in zip(COLORS, CELLS, strict=True)]
    title = "levels of detail"
    return Stage(
        title, world, actors, camera, STEP, 4.5, act=choice, caption=caption, legend=legend, backdrop="studio"
    )


class Choice:
    """Chooses a level for each ball before every step, and records all levels that the ball has used."""

    def __init__(self, eye: NDArray[np.float64]) -> None:
        self.eye = eye
        self.seen: dict[Body, set[int]] = {}

    def __call__(self, world: World) -> None:
        for body in world.bodies:
            body.set_level(level_of(body, self.eye))
            self.seen.setdefault(body, set()).add(body.level)


def level_of(body: Body, eye: NDArray[np.float64]) -> int:
    """Return the level of detail for a body's distance from the camera, with hysteresis."""
    apart = float(np.linalg.norm(body.center_of_mass() - eye))
    coarser = sum(apart > each for each in DISTANCES)
    finer = sum(apart > each - HYSTERESIS for each in DISTANCES)
    return min(max(body.level, coarser), finer)


def paint(body: Body) -> NDArray[np.float32]:
    """Return the colour of the body's level for each vertex, (n, 3)."""
    return np.tile(np.array(COLORS[body.level], dtype=np.float32), (body.vertex_count, 1))


def proof(stage: Stage) -> float:
    """Return the number of balls that have used all levels."""
    assert isinstance(stage.act, Choice)
    return float(sum(levels == set(range(len(CELLS))) for levels in stage.act.seen.values()))


if __name__ == "__main__":
    main("demo", "lod")
