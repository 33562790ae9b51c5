"""Soft rings roll down a slope towards the camera, of more tetrahedra the nearer they are."""

import numpy as np
import trimesh
from numpy.typing import NDArray

from engine_adapter import FixedStep
from taichi_soft import Body, BoxShape, Contact, Material, SoftBodyAsset, World
from taichi_soft.cli import main
from taichi_soft.render import PALETTE, Camera
from taichi_soft.render.film import Actor, Stage

CELLS = (10, 7, 5)  # of the levels along the longest side, the finest first
DISTANCES = (7.5, 11.0)  # from the camera, beyond which the second and the third level do [m]
SLACK = 0.5  # that a body must come nearer before it is finer again [m]
JELLY = Material(young=6.0e4, poisson=0.4, density=300.0)
COUNT = 5
SLOPE, LENGTH, WIDTH = 0.26, 16.0, 6.0  # [rad], [m], [m]
COLORS = tuple(PALETTE[i] for i in (0, 2, 3))  # of the levels
STEP = FixedStep(dt=1 / 50)


def stage() -> Stage:
    """The rings upright at the upper end of the slope."""
    ring = trimesh.creation.torus(0.55, 0.22)
    ring.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (0, 1, 0)))
    asset = SoftBodyAsset.from_surface(ring, JELLY, cells=CELLS, contact=Contact(friction=0.8))
    world = World(friction=0.8)
    turn = (np.sin(SLOPE / 2), 0.0, 0.0, np.cos(SLOPE / 2))
    middle = 0.5 * LENGTH * np.array([0.0, np.cos(SLOPE), np.sin(SLOPE)])
    world.add_collider(BoxShape((WIDTH, LENGTH, 0.2)), position=middle, rotation=turn, friction=0.8)
    for i in range(COUNT):
        y = 0.92 * LENGTH - 1.2 * (i % 2) - 0.4 * i
        place = (1.15 * (i - (COUNT - 1) / 2), y, y * np.tan(SLOPE) + 1.0)
        world.add_body(asset, position=place, velocity=(0.0, -1.5, 0.0))
    world.build()
    camera = Camera.framing((-2.6, 0.0, 0.2), (2.6, 6.0, 2.5), aspect=16 / 9, azimuth=-90, elevation=16)
    eye = np.asarray(camera.eye)

    def choose(world: World) -> None:
        for body in world.bodies:
            body.set_level(level_of(body, eye))

    def caption() -> str:
        now = sum(len(body.tets) for body in world.bodies)
        return f"{now:,} of {COUNT * len(asset.mesh.tets):,} tetrahedra"

    actors = [Actor(body, paint=paint) for body in world.bodies]
    legend = [(color, f"{cells} cells") for color, cells in zip(COLORS, CELLS, strict=True)]
    return Stage(
        "levels of detail", world, actors, camera, STEP, 5.0, act=choose, caption=caption, legend=legend
    )


def level_of(body: Body, eye: NDArray[np.float64]) -> int:
    """By distance, and by what it has: a body on a border does not change in every step."""
    apart = float(np.linalg.norm(body.center_of_mass() - eye))
    coarser = sum(apart > each for each in DISTANCES)
    finer = sum(apart > each - SLACK for each in DISTANCES)
    return min(max(body.level, coarser), finer)


def paint(body: Body) -> NDArray[np.float32]:
    """The colour of its level at every vertex."""
    return np.tile(np.array(COLORS[body.level], dtype=np.float32), (body.vertex_count, 1))


def proof(stage: Stage) -> float:
    """How many rings have come down and are fine now."""
    return float(sum(body.level == 0 and body.center_of_mass()[1] < 4.0 for body in stage.world.bodies))


if __name__ == "__main__":
    main("demo", "lod")
