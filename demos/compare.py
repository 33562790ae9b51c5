"""The same sphere under every law, each labelled with what a step of it costs.

On tetrahedra the laws agree while strains are small. Along edges they know Poisson's ratio at most by its
effect on volume, and CMPM and its variants take strain by the direction of each edge (thesis section 4.3).
"""

from functools import partial
from statistics import median

from engine_adapter import FixedStep
from taichi_soft import LAWS, Material, TetMesh, World, sphere
from taichi_soft.cli import main
from taichi_soft.lab.profiling.spread import time_calls
from taichi_soft.render import PALETTE, Camera
from taichi_soft.render.film import Actor, Stage

SOFT = Material(young=6.0e5, poisson=0.2, density=1000.0, damping=30.0, damping_ratio=0.0)
HEIGHT = 2.2  # of the centres [m]
STEP = FixedStep(dt=1 / 50, substeps=10)
PER_ROW = 4
PITCH, DEPTH = 3.4, 4.4  # between spheres, across and away from the eye [m]


def stage() -> Stage:
    """Spheres of 540 tetrahedra 4 m above the floor, one for each law."""
    mesh = sphere(1.0, 3)
    world = World()
    actors = []
    for i, law in enumerate(LAWS):
        row, column = divmod(i, PER_ROW)
        in_row = min(PER_ROW, len(LAWS) - row * PER_ROW)
        place = PITCH * (column - (in_row - 1) / 2), -DEPTH * row, HEIGHT
        body = world.add_body(mesh, SOFT, law=law, position=place)
        actors.append(
            Actor(body, PALETTE[i % len(PALETTE)], label=f"{_in_lines(law)}\n{_cost(mesh, law):.2f} ms")
        )
    world.build()
    rows = -(-len(LAWS) // PER_ROW)
    edge = PITCH * (PER_ROW - 1) / 2 + 1.3
    camera = Camera.framing(
        (-edge, -DEPTH * (rows - 1) - 2.0, 0),
        (edge, 1, 2.0),
        aspect=16 / 9,
        azimuth=-90,
        elevation=34,
        margin=1.0,
    )
    return Stage("one sphere, every law, time of a step", world, actors, camera, STEP, seconds=6.0)


def _in_lines(law: str) -> str:
    """A long name in two lines, broken after an underscore."""
    head, _, tail = law.rpartition("_")
    return f"{head}_\n{tail}" if len(law) > 14 else law


def _cost(mesh: TetMesh, law: str) -> float:
    """Median time of one fixed step of the sphere alone [ms]."""
    world = World(floor=None)
    world.add_body(mesh, SOFT, law=law)
    world.build()
    step = partial(world.step, STEP.dt, STEP.substeps)
    time_calls(step, 2)
    return median(time_calls(step, 9)) * 1e3


def proof(stage: Stage) -> float:
    """How many spheres are whole: sound, and no tetrahedron inside out."""
    return float(sum(not actor.body.is_frozen and actor.body.flipped_count() == 0 for actor in stage.actors))


if __name__ == "__main__":
    main("demo", "compare")
