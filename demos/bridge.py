"""Soft bodies fall onto a rope bridge, which sags, swings, and carries them.

The bridge is one mesh of two materials: the planks stay straight, and the ropes between the planks bend.
"""

import numpy as np

from engine_adapter import FixedStep
from taichi_soft import Attachment, BoxShape, Contact, Material, TetMesh, World, box, sphere, torus
from taichi_soft.cli import main
from taichi_soft.core.constants import GRAVITY_EARTH
from taichi_soft.render import PALETTE, Camera
from taichi_soft.render.film import Actor, Stage

PLANKS, PLANK, GAP = (
    13,
    0.3,
    0.12,
)  # number of planks, their length along the bridge, and the gap between them [m]
WIDTH, ROPE, THICKNESS = (
    1.7,
    0.12,
    0.12,
)  # width of the bridge, width of its side ropes, thickness of planks and ropes [m]
EDGE = 0.16  # height of the ropes' outer edges above the planks [m]; they stop rolling bodies
HEIGHT = 1.5  # height of the straight bridge [m]
WOOD, HEMP = 1.5e6, 1.0e6  # Young's moduli of planks and ropes [Pa]
SOFT = Material(young=3.0e4, poisson=0.3, density=400.0, damping_ratio=0.1)
DRAG = 1.0  # damping rate of the bodies [1/s]; it makes the bridge stop swinging
LENGTH = PLANKS * PLANK + (PLANKS - 1) * GAP
STEP = FixedStep(dt=1 / 50)


class Carriers:
    """Records the load on both ends of the bridge in each step."""

    def __init__(self, holds: list[Attachment]) -> None:
        """Start with no recorded loads."""
        self.holds = holds
        self.loads: list[float] = []  # downward load in each step [N]

    def __call__(self, world: World) -> None:
        """Record the load of the last step."""
        if world.step_count:
            self.loads.append(-sum(float(hold.force[2]) for hold in self.holds))


def stage() -> Stage:
    """Make the stage: a straight bridge between two pillars, with bodies above it."""
    mesh = _bridge()
    columns = mesh.vertices[mesh.tets].mean(axis=1)[:, 0] % (PLANK + GAP)
    material = Material(np.where(columns < PLANK, WOOD, HEMP), 0.2, 300.0, damping_ratio=0.1)
    world = World()
    pillar = BoxShape((1.2, WIDTH + 0.2, HEIGHT))
    for x in (-0.65, LENGTH + 0.65):
        world.add_collider(pillar, position=(x, 0.0, HEIGHT / 2))
    contact, cube = Contact(friction=0.6, thickness=0.02), box((0.6, 0.6, 0.6), (4, 4, 4))
    bridge = world.add_body(mesh, material, position=(0.0, 0.0, HEIGHT), contact=contact)
    for i, (shape, x) in enumerate(((torus(0.36, 0.15), 1.2), (sphere(0.4, 3), 2.7), (cube, 4.1))):
        world.add_body(shape, SOFT, position=(x, 0.0, HEIGHT + 0.7 + 0.3 * i), contact=contact)
    world.build()
    for body in world.bodies:
        body.set_linear_damping(DRAG)
    holds = []
    for x in (0.0, LENGTH):
        end = np.flatnonzero(np.abs(mesh.vertices[:, 0] - x) < 1e-6)
        holds.append(bridge.attach(end, world.add_frame((x, 0.0, HEIGHT)), two_way=True))
    is_wood = (mesh.vertices[:, 0] + 1e-6) % (PLANK + GAP) < PLANK + 2e-6
    inner = np.abs(mesh.vertices[:, 1]) < WIDTH / 2 - ROPE / 2
    colors = np.where((is_wood & inner)[:, None], PALETTE[7], (0.90, 0.82, 0.66)).astype(np.float32)
    actors = [Actor(bridge, paint=lambda body: colors)]
    actors += [Actor(body, PALETTE[i]) for i, body in enumerate(world.bodies[1:])]
    box_seen = (-0.8, -0.8, 0.2), (LENGTH + 1.1, 0.8, HEIGHT + 1.2)
    camera = Camera.framing(*box_seen, aspect=16 / 9, azimuth=-76, elevation=14, margin=1.0)
    return Stage("a rope bridge", world, actors, camera, STEP, 8.0, act=Carriers(holds), backdrop="dusk")


def _bridge() -> TetMesh:
    """Make planks joined by ropes along both sides, from x = 0 to the length of the bridge."""
    along, across = 2 * PLANKS - 1, 7
    grid = box((along, across, 1), (along, across, 1))
    grid = grid.translated(-grid.bounds[0])
    cells = np.floor(grid.vertices[grid.tets].mean(axis=1)).astype(int)
    kept = grid.tets[(cells[:, 0] % 2 == 0) | (cells[:, 1] == 0) | (cells[:, 1] == across - 1)]
    used, tets = np.unique(kept, return_inverse=True)
    x, y, z = grid.vertices[used].T
    lengths = np.concatenate([[0.0], np.cumsum(np.resize([PLANK, GAP], along))])
    widths = np.concatenate(
        [[-WIDTH / 2], np.linspace(ROPE - WIDTH / 2, WIDTH / 2 - ROPE, across - 1), [WIDTH / 2]]
    )
    places = [np.interp(x, np.arange(along + 1), lengths), np.interp(y, np.arange(across + 1), widths)]
    rise = np.where((y < 0.5) | (y > across - 0.5), EDGE, 0.0)
    return TetMesh(np.stack([*places, THICKNESS * (z - 0.5) + rise], axis=1), tets.reshape(kept.shape))


def proof(stage: Stage) -> float:
    """Return the mean load on both ends in the last 2 s, divided by the weight of the bridge and all bodies
    on the bridge.
    """
    carriers = stage.act
    assert isinstance(carriers, Carriers)
    mass = sum(float(body.masses.sum()) for body in stage.world.bodies)
    return float(np.mean(carriers.loads[-round(2.0 / STEP.dt) :])) / (mass * GRAVITY_EARTH)


if __name__ == "__main__":
    main("demo", "bridge")
