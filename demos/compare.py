"""Equal spheres fall, one for each force law; the legend shows the cost of a step.

Laws with forces on tetrahedra agree for small strains. In laws with forces along edges, Poisson's ratio
affects at most the volume. CMPM and its variants compute the strain along each edge (thesis section 4.3).
"""

from functools import partial
from statistics import median

from engine_adapter import FixedStep
from taichi_soft import LAWS, Material, TetMesh, World, sphere
from taichi_soft.cli import main
from taichi_soft.core.extras import missing_packages
from taichi_soft.profiling.spread import time_calls
from taichi_soft.render import PALETTE, Camera
from taichi_soft.render.film import Actor, Stage

SOFT = Material(young=6.0e5, poisson=0.2, density=1000.0, damping=30.0, damping_ratio=0.0)
HEIGHT = 2.2  # initial height of the centres [m]
STEP = FixedStep(dt=1 / 50, substeps=10)
PER_ROW = 3
COLORS = (*PALETTE, (0.93, 0.92, 0.88), (0.58, 0.16, 0.24), (0.70, 0.85, 0.30), (0.45, 0.75, 0.72))
NO_BODY = (0.09, 0.10, 0.13)  # legend colour of laws that cannot run
PITCH, DEPTH = 2.8, 3.2  # distance between spheres, across and along the view [m]


def stage() -> Stage:
    """Make the stage: spheres of 540 tetrahedra above the floor, one per law."""
    mesh = sphere(1.0, 3)
    world = World(soft_contact=False, sleep_speed=0.0)
    actors = []
    missing = {"cmpm": missing_packages("voronoi")}
    laws = [law for law in LAWS if not missing.get(law)]
    for i, law in enumerate(laws):
        row, column = divmod(i, PER_ROW)
        in_row = min(PER_ROW, len(laws) - row * PER_ROW)
        place = PITCH * (column - (in_row - 1) / 2), -DEPTH * row, HEIGHT
        body = world.add_body(mesh, SOFT, law=law, position=place)
        actors.append(Actor(body, COLORS[i]))
    world.build()
    rows = -(-len(laws) // PER_ROW)
    left, right = -PITCH - 1.2, PITCH + 1.2
    seen = (left, -DEPTH * (rows - 1) - 1.4, 0.0), (right + 1.8 * (right - left), 1.0, 2.8)
    camera = Camera.framing(*seen, aspect=16 / 9, azimuth=-90, elevation=38, margin=1.0)
    legend = [(COLORS[i], f"{law}  {_cost(mesh, law):.2f} ms") for i, law in enumerate(laws)]
    legend += [(NO_BODY, f"{law}  needs {', '.join(names)}") for law, names in missing.items() if names]
    return Stage(
        "every law, time of a step", world, actors, camera, STEP, seconds=6.0, legend=legend, backdrop="paper"
    )


def _cost(mesh: TetMesh, law: str) -> float:
    """Return the median time of a fixed step of a single sphere [ms]."""
    world = World(floor=None)
    world.add_body(mesh, SOFT, law=law)
    world.build()
    step = partial(world.step, STEP.dt, STEP.substeps)
    time_calls(step, 2)
    return median(time_calls(step, 9)) * 1e3


def proof(stage: Stage) -> float:
    """Return the number of valid spheres: not frozen, and without inverted tetrahedra."""
    return float(sum(not actor.body.is_frozen and actor.body.flipped_count() == 0 for actor in stage.actors))


if __name__ == "__main__":
    main("demo", "compare")
