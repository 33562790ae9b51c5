"""Sixty-four soft spheres rain down. Each CPU core steps one sphere at a time, in parallel.

The spheres land at different times, and each sphere deforms and bounces independently.
"""

from engine_adapter import FixedStep
from taichi_soft import Material, World, load_mesh
from taichi_soft.cli import main
from taichi_soft.core.package_data import ASSETS
from taichi_soft.render import PALETTE, Camera
from taichi_soft.render.film import Actor, Stage

ROWS = 8
PITCH = 2.8  # distance between the centres of spheres [m]
LOWEST, SPREAD = 1.3, 4.5  # smallest initial height, and range of initial heights [m]
SOFT = Material(young=2.0e5, poisson=0.3, density=1000.0, damping_ratio=0.03)


def stage() -> Stage:
    """Make the stage: a square grid of spheres at irregular heights."""
    mesh = load_mesh(ASSETS / "sphere.npz")
    world = World(soft_contact=False, sleep_speed=0.0)
    actors = []
    for i in range(ROWS * ROWS):
        row, column = divmod(i, ROWS)
        height = LOWEST + SPREAD * (i * 0.618 % 1.0)
        place = (PITCH * (column - 3.5), PITCH * (row - 3.5), height)
        body = world.add_body(mesh, SOFT, position=place)
        actors.append(Actor(body, PALETTE[(row + column) % len(PALETTE)]))
    world.build()
    edge = PITCH * ROWS / 2
    seen = (-edge, -edge, 0.0), (edge, edge, 5.0)
    camera = Camera.framing(*seen, aspect=16 / 9, azimuth=-80.0, elevation=25.0, margin=1.0)
    title = f"{len(actors)} spheres, {len(actors) * len(mesh.tets):,} tetrahedra"
    return Stage(
        title, world, actors, camera, FixedStep(dt=1 / 50, substeps=14), seconds=6.0, backdrop="dusk"
    )


def proof(stage: Stage) -> float:
    """Return the number of valid spheres: not frozen, and without inverted tetrahedra."""
    return float(sum(a.body.flipped_count() == 0 and not a.body.is_frozen for a in stage.actors))


if __name__ == "__main__":
    main("demo", "many")
