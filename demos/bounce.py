"""The thesis's sphere falls from 7 m (section 6.6): volume 4 m^3, E = 1 MPa, 700 steps per second.

The sphere flattens at the impact. While it flies up again, its shape oscillates between flat and long.
"""

from engine_adapter import FixedStep
from taichi_soft import World, load_mesh, preset
from taichi_soft.cli import main
from taichi_soft.core.package_data import ASSETS
from taichi_soft.render import Camera
from taichi_soft.render.film import Actor, Stage

HEIGHT = 7.0  # initial height of the lowest point [m]


def stage() -> Stage:
    """Make the stage: the sphere before its fall."""
    mesh = load_mesh(ASSETS / "sphere.npz")
    world = World()
    body = world.add_body(
        mesh, preset("thesis_sphere"), position=(0.0, 0.0, HEIGHT - mesh.bounds[0][2]), law="virial"
    )
    world.build()
    # The sphere fills a quarter of the image near the floor, and is still in view at the top.
    camera = Camera(eye=(1.1, -5.3, 1.2), target=(0.0, 0.0, 3.4), fov_degrees=82.0)
    step = FixedStep(dt=1 / 50, substeps=14)
    title = f"E = 1 MPa, falls {HEIGHT:g} m"
    return Stage(title, world, [Actor(body)], camera, step, seconds=8.0)


def proof(stage: Stage) -> float:
    """Return the distance that the sphere has fallen [m]: g t^2 / 2 until it lands."""
    body = stage.actors[0].body
    start = body.masses @ body.mesh.vertices[:, 2] / body.masses.sum() + HEIGHT - body.mesh.bounds[0][2]
    return float(start - body.center_of_mass()[2])


if __name__ == "__main__":
    main("demo", "bounce")
