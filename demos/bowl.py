"""Twenty soft bodies are dropped into a bowl, a collider made of triangles, and fall asleep in a heap.

Bodies slide down the wall and deform each other, but do not penetrate each other.
"""

import numpy as np
import trimesh
from numpy.typing import NDArray

from engine_adapter import FixedStep
from taichi_soft import Body, Contact, Material, MeshShape, World, box, cylinder, sphere, torus
from taichi_soft.cli import main
from taichi_soft.render import PALETTE, Camera
from taichi_soft.render.film import Actor, Stage

MATERIAL = Material(young=3.0e5, poisson=0.3, density=500.0)
THICKNESS = 0.02  # contact thickness of the bodies [m]
RADIUS, WALL = 2.0, 0.2  # inner radius and thickness of the bowl [m]
BODIES = 20
DRAG = 1.0  # damping rate [1/s]; without it, balls would roll between other bodies forever
STEP = FixedStep(dt=1 / 50)


def stage() -> Stage:
    """Make the stage: bodies of four shapes in three layers above the bowl."""
    shapes = [
        sphere(0.36, 3),
        box((0.6, 0.6, 0.6), (4, 4, 4)),
        cylinder(0.34, 0.6, rings=2, layers=4),
        torus(0.34, 0.15, rings=1, segments=18),
    ]
    world = World()
    world.add_collider(MeshShape(_bowl()), position=(0, 0, RADIUS + WALL + 0.01), friction=0.4)
    actors = []
    for i in range(BODIES):
        layer, number = divmod(i, 7)  # one body in the centre of a layer, six around it
        angle, reach = np.pi / 3 * number + 0.5 * layer, 0.95 if number else 0.0
        place = (reach * np.cos(angle), reach * np.sin(angle), 1.9 + 0.9 * layer)
        mesh = shapes[(i + layer) % 4]
        contact = Contact(friction=0.4, thickness=THICKNESS)
        body = world.add_body(mesh, MATERIAL, law="neo_hookean", position=place, contact=contact)
        actors.append(Actor(body, PALETTE[i % len(PALETTE)]))
    world.build()
    for body in world.bodies:
        body.set_linear_damping(DRAG)
    camera = Camera.framing((-1.8, -1.8, 0.2), (1.8, 1.8, 3.2), aspect=16 / 9, elevation=52, margin=1.0)
    return Stage(f"{BODIES} bodies in a bowl", world, actors, camera, STEP, 5.0)


def _bowl() -> trimesh.Trimesh:
    """Make the lower half of a hollow ball with a round rim. The origin is the centre of the opening."""
    angles = np.linspace(0, np.pi / 2, 25)
    outer = (RADIUS + WALL) * np.column_stack([np.sin(angles), -np.cos(angles)])
    inner = RADIUS * np.column_stack([np.sin(angles), -np.cos(angles)])[::-1]
    bend = np.linspace(0, np.pi, 7)[1:-1]
    rim = np.column_stack([RADIUS + WALL / 2 * (1 + np.cos(bend)), WALL / 2 * np.sin(bend)])
    return trimesh.creation.revolve(np.concatenate([outer, rim, inner]), sections=72)


def proof(stage: Stage) -> float:
    """Return the depth of the deepest vertex inside another body [m]; 0 if no vertex is inside."""
    depths = [
        near.distance
        for body in stage.world.bodies
        for point in body.positions()[np.unique(body.surface)]
        for near in [_nearest_of_others(stage.world, body, point)]
        if near is not None and near.is_inside
    ]
    return max(depths, default=0.0)


def _nearest_of_others(world: World, body: Body, point: NDArray[np.float32]):  # type: ignore[no-untyped-def]
    others = [other for other in world.bodies if other is not body]
    return world.closest_point(point, max_distance=0.2, bodies=others)


if __name__ == "__main__":
    main("demo", "bowl")
