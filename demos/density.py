"""A block that is denser on the right falls (fig. 6.3). Its heavy side deforms most and rises last.

The light side is in the air while the heavy side is still compressed, so the block rotates as it rises. The
heavy side rises least.
"""

import numpy as np

from engine_adapter import FixedStep
from taichi_soft import Material, World, box
from taichi_soft.cli import main
from taichi_soft.render import Camera, ColorScale
from taichi_soft.render.film import Actor, Stage

LIGHT, HEAVY = 200.0, 2000.0  # densities at the left and at the right end [kg/m^3]


def stage() -> Stage:
    """Make the stage: a horizontal block above the floor."""
    mesh = box((3.0, 1.5, 1.5), (8, 4, 4))
    mesh = mesh.translated(-np.mean(mesh.bounds, axis=0))
    right = (mesh.vertices[mesh.tets].mean(axis=1)[:, 0] + 1.5) / 3.0
    material = Material(
        young=3.0e5, poisson=0.2, density=LIGHT + (HEAVY - LIGHT) * right, damping=20.0, damping_ratio=0.0
    )
    world = World()
    body = world.add_body(mesh, material, position=(0.0, 0.0, 2.75), law="virial", flips="recover")
    world.build()
    scale = ColorScale("density", LIGHT, HEAVY, "kg/m^3")
    colors = scale.colors(LIGHT + (HEAVY - LIGHT) * (mesh.vertices[:, 0] + 1.5) / 3.0)
    camera = Camera.framing((-2.0, -0.8, 0.0), (2.8, 0.8, 4.7), aspect=16 / 9, azimuth=-75.0, elevation=8.0)
    actor = Actor(body, paint=lambda body: colors)
    return Stage("heavier to the right", world, [actor], camera, FixedStep(dt=1 / 50), 5.0, scale=scale)


def proof(stage: Stage) -> float:
    """Return the height of the light end above the heavy end [m]."""
    body = stage.actors[0].body
    x, now = body.mesh.vertices[:, 0], body.positions()[:, 2]
    return float(now[x < x.min() + 0.1].mean() - now[x > x.max() - 0.1].mean())


if __name__ == "__main__":
    main("demo", "density")
