"""Two soft spheres hit the floor hard. Inverted tetrahedra recover only in the right sphere.

The left sphere tolerates inverted tetrahedra, as in the thesis (section 6.6). Inverted tetrahedra are at rest
in their mirrored shape, so the dent remains.
"""

import numpy as np
from numpy.typing import NDArray

from engine_adapter import FixedStep
from taichi_soft import Body, Material, World, load_mesh
from taichi_soft.cli import main
from taichi_soft.core.package_data import ASSETS
from taichi_soft.render import FLIPPED, PALETTE, Camera, highlight
from taichi_soft.render.film import Actor, Stage

SOFT = Material(young=2.0e5, poisson=0.1, density=1000.0, damping=100.0, damping_ratio=0.0)


def stage() -> Stage:
    """Make the stage: two spheres above the floor that move down at 6 m/s."""
    mesh = load_mesh(ASSETS / "sphere.npz")
    world = World(soft_contact=False, sleep_speed=0.0)
    actors = []
    for flips, x, color in (("tolerant", -1.6, PALETTE[0]), ("recover", 1.6, PALETTE[1])):
        body = world.add_body(
            mesh, SOFT, flips=flips, position=(x, 0.0, 3.0), velocity=(0.0, 0.0, -6.0), law="virial"
        )
        actors.append(Actor(body, paint=_mark_flips(color), label=f'flips="{flips}"'))
    world.build()
    camera = Camera.framing((-3.0, -1.6, -0.3), (3.0, 1.2, 4.5), aspect=16 / 9, azimuth=-90.0, elevation=9.0)
    legend = [(FLIPPED, "flipped")]
    step = FixedStep(dt=1 / 50, substeps=14)
    return Stage(
        "E = 0.2 MPa, 6 m/s downwards",
        world,
        actors,
        camera,
        step,
        seconds=5.0,
        legend=legend,
        backdrop="studio",
    )


def _mark_flips(color: tuple[float, float, float]):  # type: ignore[no-untyped-def]
    def paint(body: Body) -> NDArray[np.float32]:
        flagged = np.zeros(body.vertex_count, dtype=bool)
        flagged[body.tets[body.volumes() < 0].ravel()] = True
        return highlight(flagged, color)

    return paint


def proof(stage: Stage) -> float:
    """Return the number of inverted tetrahedra of the tolerant sphere minus the number of the recovering
    sphere.
    """
    tolerant, recover = (actor.body.flipped_count() for actor in stage.actors)
    return float(tolerant - recover)


if __name__ == "__main__":
    main("demo", "dents")
