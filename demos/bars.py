"""An object made of bars falls on its corner, bends, and keeps vibrating after it lifts off (fig. 6.2).

The arms vibrate long after the impact. The crossings of the bars turn red each time the arms bend.
"""

import numpy as np
from numpy.typing import NDArray

from engine_adapter import FixedStep
from taichi_soft import Body, Material, World, load_mesh
from taichi_soft.cli import main
from taichi_soft.core.package_data import ASSETS
from taichi_soft.render import Camera, ColorScale
from taichi_soft.render.film import Actor, Stage

MATERIAL = Material(young=6.0e5, poisson=0.2, density=1000.0, damping=20.0, damping_ratio=0.0)
STRESS = ColorScale("von Mises stress", 0.0, 1.0e5, "Pa")


def stage() -> Stage:
    """Make the stage: the tilted bars above the floor."""
    mesh = load_mesh(ASSETS / "bars.npz")
    mesh = mesh.translated(-np.mean(mesh.bounds, axis=0))
    reach = float(np.linalg.norm(mesh.vertices, axis=1).max())
    world = World()
    body = world.add_body(mesh, MATERIAL, rotation=_tilt(0.5), position=(0.0, 0.0, reach + 0.6), law="virial")
    world.build()
    camera = Camera.framing(
        (-reach, -reach, 0.0), (reach, reach, 2.0 * reach + 0.4), aspect=16 / 9, elevation=12.0, margin=1.0
    )
    actor = Actor(body, paint=_stress)
    title = f"bars, {len(mesh.tets)} tetrahedra"
    return Stage(
        title, world, [actor], camera, FixedStep(dt=1 / 50), seconds=6.0, scale=STRESS, backdrop="paper"
    )


def _tilt(angle: float) -> NDArray[np.float64]:
    c, s = np.cos(angle), np.sin(angle)
    about_x = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    about_y = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return about_x @ about_y


def _stress(body: Body) -> NDArray[np.float32]:
    return STRESS.colors(body.vertex_stress())


def proof(stage: Stage) -> float:
    """Return the ratio of the volume to the rest volume."""
    body = stage.actors[0].body
    return body.volume() / body.mesh.volume


if __name__ == "__main__":
    main("demo", "bars")
