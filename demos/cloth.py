"""A cloth of springs pinned at two corners swings down, with one implicit step per frame.

The free edge lags behind, and whips around whenever the cloth swings back.
"""

import numpy as np

from engine_adapter import FixedStep
from taichi_soft import SpringMaterial, World, cloth, cloth_constants
from taichi_soft.cli import main
from taichi_soft.render import PALETTE, Camera
from taichi_soft.render.film import Actor, Stage

CELLS = (24, 24)
SIDE, MASS = 2.0, 0.5  # edge [m] and mass [kg] of the cloth


def stage() -> Stage:
    """Make the stage: a horizontal cloth pinned at two corners."""
    mesh = cloth((SIDE, SIDE), CELLS, MASS)
    stiffness = cloth_constants(mesh, CELLS, tensile=400.0, shear=150.0, bend=3.0)
    world = World(integrator="implicit_euler")
    corners = [0, CELLS[1]]
    material = SpringMaterial(stiffness, damping=0.05)
    body = world.add_body(mesh, material, law="springs", pinned=corners, position=(SIDE / 2, 0, 2.4))
    world.build()
    camera = Camera.framing(
        (-0.9, -1.0, 0.4), (1.5, 1.0, 2.5), aspect=16 / 9, azimuth=-50, elevation=8, margin=1.05
    )
    return Stage(
        "cloth, one implicit step a frame",
        world,
        [Actor(body, PALETTE[2], look="cloth")],
        camera,
        FixedStep(dt=1 / 60, substeps=1),
        seconds=5.0,
    )


def proof(stage: Stage) -> float:
    """Return the largest ratio of a thread's length to its rest length."""
    (actor,) = stage.actors
    mesh = actor.body.mesh
    threads = mesh.edge_lengths < 1.01 * SIDE / CELLS[0]
    ends = actor.body.positions()[mesh.edges[threads]]
    return float((np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / mesh.edge_lengths[threads]).max())


if __name__ == "__main__":
    main("demo", "cloth")
