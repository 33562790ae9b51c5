"""The same undamped sphere under every law: the thesis's gain energy until they break, the others never do.

Section 6.4 of the thesis sees kinetic energy accumulate without damping: its stress belongs to no energy.
"""

from functools import partial
from statistics import median

from engine_adapter import FixedStep
from taichi_soft import LAWS, Body, Material, TetMesh, World, load_mesh
from taichi_soft.cli import main
from taichi_soft.constants import GRAVITY_EARTH
from taichi_soft.film import Actor, Stage
from taichi_soft.profiling.spread import time_calls
from taichi_soft.render import PALETTE, Camera
from taichi_soft.stages import ASSETS

UNDAMPED = Material(young=1.0e6, poisson=0.4, density=1000.0, damping=0.0)
HEIGHT = 4.0  # of the centres [m]
STEP = FixedStep(dt=1 / 50, substeps=20)
PITCH, DEPTH = 4.2, 2.4  # between spheres: across, and every other one towards the eye [m]


def stage() -> Stage:
    """A row of spheres 4 m above the floor, one for each law, labelled with what a step of it costs."""
    mesh = load_mesh(ASSETS / "sphere.npz")
    world = World()
    actors = []
    for i, law in enumerate(LAWS):
        place = PITCH * (i - (len(LAWS) - 1) / 2), DEPTH * (-1) ** i, HEIGHT
        body = world.add_body(mesh, UNDAMPED, law=law, position=place)
        actors.append(Actor(body, PALETTE[i % len(PALETTE)], label=f"{law}, {_cost(mesh, law):.2f} ms"))
    world.build()
    edge = PITCH * len(LAWS) / 2
    camera = Camera.framing((-edge, -3, 0), (edge, 3, 5), aspect=16 / 9, azimuth=-90, elevation=26)
    return Stage("no damping, nu = 0.4: who keeps the energy?", world, actors, camera, STEP, seconds=8.0)


def _cost(mesh: TetMesh, law: str) -> float:
    """Median time of one fixed step of the sphere alone [ms]."""
    world = World(floor=None)
    world.add_body(mesh, UNDAMPED, law=law)
    world.build()
    step = partial(world.step, STEP.dt, STEP.substeps)
    time_calls(step, 2)
    return median(time_calls(step, 9)) * 1e3


def energy(body: Body) -> float:
    """Kinetic, gravitational and elastic energy [J]."""
    return body.kinetic_energy() + body.gravitational_energy() + body.elastic_energy()


def proof(stage: Stage) -> float:
    """Energy of the sphere that has gained most, over what each started with."""
    start = stage.actors[0].body.masses.sum() * GRAVITY_EARTH * HEIGHT
    return max(energy(actor.body) for actor in stage.actors) / float(start)


if __name__ == "__main__":
    main("demo", "compare")
