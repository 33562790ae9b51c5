"""A tower of slabs, each softer than the one below: a heavy one falls on it, the softest give way most.

The top slab is squashed most, although those below it carry more: it is the softest.
"""

import numpy as np
from numpy.typing import NDArray

from engine_adapter import FixedStep
from taichi_soft import Contact, Material, World, box
from taichi_soft.cli import main
from taichi_soft.render import PALETTE, Camera
from taichi_soft.render.film import Actor, Stage

STIFFNESSES = (4.0e5, 1.6e5, 8.0e4, 4.0e4, 2.5e4)  # Young's moduli, from the bottom [Pa]
LIGHT = 150.0  # density of these slabs [kg/m^3]
HEAVY = Material(young=3.0e6, poisson=0.3, density=1500.0, damping_ratio=0.3)
SIZE, LOAD = (1.7, 1.7, 0.4), (1.7, 1.7, 0.3)  # of the slabs and of the heavy one [m]
SKIN, DROP = 0.02, 0.3  # between slabs, and how far the heavy one falls [m]
DRAG = 0.5  # [1/s]
STEP = FixedStep(dt=1 / 50)


def stage() -> Stage:
    """The slabs on each other, not squashed yet, and the heavy one above them."""
    world = World(soft_contact=True, friction=0.8)
    contact = Contact(friction=0.8, thickness=SKIN)
    slab, load = box(SIZE, (6, 6, 3)), box(LOAD, (6, 6, 2))
    for i, young in enumerate(STIFFNESSES):
        material = Material(young, 0.3, LIGHT, damping_ratio=0.3)
        world.add_body(slab, material, position=_on_floor(i * (SIZE[2] + SKIN)), contact=contact)
    top = len(STIFFNESSES) * (SIZE[2] + SKIN) + DROP
    world.add_body(load, HEAVY, position=(0.0, 0.0, top + LOAD[2] / 2), contact=contact)
    world.build()
    for body in world.bodies:
        body.set_linear_damping(DRAG)
    colors = [PALETTE[i] for i in (3, 1, 4, 2, 0, 7)]
    actors = [Actor(body, color) for body, color in zip(world.bodies, colors, strict=True)]
    legend = [(colors[i], f"{young / 1e3:g} kPa") for i, young in enumerate(STIFFNESSES)]
    weight = float(world.bodies[-1].masses.sum())
    camera = Camera.framing((-0.9, -0.9, 0.1), (0.9, 0.9, 2.9), aspect=16 / 9, azimuth=-60, elevation=8)
    return Stage(f"{weight:.0f} kg on slabs", world, actors, camera, STEP, 5.0, legend=legend[::-1])


def _on_floor(height: float) -> NDArray[np.float64]:
    """Where a slab's middle is whose lower face is there [m]."""
    return np.array([0.0, 0.0, 0.01 + height + SIZE[2] / 2])


def squashes(stage: Stage) -> NDArray[np.float64]:
    """By how much of its height each slab is pressed together, from the bottom."""
    found = []
    for body in stage.world.bodies[:-1]:
        rest, now = body.mesh.vertices[:, 2], body.positions()[:, 2]
        upper, lower = rest > rest.max() - 1e-6, rest < rest.min() + 1e-6
        found.append(1.0 - float(now[upper].mean() - now[lower].mean()) / SIZE[2])
    return np.array(found)


def proof(stage: Stage) -> float:
    """How many slabs are squashed more than the firmer one below them."""
    return float((np.diff(squashes(stage)) > 0).sum())


if __name__ == "__main__":
    main("demo", "tower")
