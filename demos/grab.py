"""A hand picks up bodies one by one and throws them into a crate.

A held body hangs from the grabbed point and sways behind the hand.
"""

import numpy as np

from engine_adapter import FixedStep
from taichi_soft import (
    Body,
    BoxShape,
    Contact,
    Frame,
    Grab,
    Material,
    SphereShape,
    World,
    box,
    cylinder,
    sphere,
    torus,
)
from taichi_soft.cli import main
from taichi_soft.core.constants import GRAVITY_EARTH
from taichi_soft.render import PALETTE, Camera
from taichi_soft.render.film import Actor, Stage
from taichi_soft.render.props import Prop

MATERIAL = Material(young=2.5e5, poisson=0.3, density=400.0, damping_ratio=0.4)
CRATE = np.array([2.4, 0.0, 0.0])  # centre of the crate's bottom [m]
INSIDE, WALL, HEIGHT = 2.4, 0.14, 1.2  # inner width of the crate, thickness and height of its walls [m]
FIRST, EVERY = 0.8, 1.7  # time of the first grab, and interval between grabs [s]
LIFT, STEEP = np.array([-0.1, 0.0, 1.3]), 0.8  # displacement of the lift [m]; slope of the throw
LIFTING, PULL = 0.7, 10.0  # duration of the lift [s], acceleration of the throw [m/s^2]
UP = np.array([0.0, 0.0, 1.0])
STEP = FixedStep(dt=1 / 50)


class Hand:
    """Reaches for a body, lifts it and swings it. Releases the body when its velocity will carry it into the
    crate.
    """

    def __init__(self, frame: Frame) -> None:
        """Start with an empty hand at rest."""
        self.frame, self.rest = frame, frame.position.astype(np.float64)
        self.taken = 0
        self.grab: Grab | None = None
        self.start = self.rest  # position at which the body was grabbed

    def __call__(self, world: World) -> None:
        """Move the hand before a step."""
        since = world.time - FIRST - EVERY * self.taken
        if self.grab is None:
            if self.taken < len(world.bodies):
                self._reach(world, since)
            return
        throwing = max(since - LIFTING, 0.0)
        if throwing > 0.0 and _flies_into_crate(self.grab.body):
            self.grab.release()
            self.grab = None
            self.taken += 1
            return
        way = (CRATE - self.start) * (1, 1, 0)
        way = way / np.linalg.norm(way) + STEEP * UP
        place = self.start + _smooth(since / LIFTING) * LIFT + PULL / 2 * throwing**2 * way
        self.grab.move(place)
        self.frame.move_to(place)

    def _reach(self, world: World, since: float) -> None:
        """Move to the top of the next body, and grab it at the scheduled time."""
        body = world.bodies[self.taken]
        over = body.center_of_mass() + 2.0 * UP
        near = world.closest_point(over, bodies=[body])
        assert near is not None
        if since >= 0.0:
            self.grab, self.start = world.grab(over, near.point - over), near.point
        self.frame.move_to(near.point + _smooth(-since / 0.6) * (self.rest - near.point))


def _smooth(share: float) -> float:
    """Return a smooth step from 0 to 1 for `share` from 0 to 1."""
    s = min(max(share, 0.0), 1.0)
    return s * s * (3.0 - 2.0 * s)


def _flies_into_crate(body: Body) -> bool:
    """True if a body that is released now would fly over the rim and past the centre of the crate."""
    share = body.masses / body.masses.sum()
    place, velocity = share @ body.positions(), share @ body.velocities()
    root = np.sqrt(max(velocity[2] ** 2 + 2.0 * GRAVITY_EARTH * (place[2] - HEIGHT), 0.0))
    landing = place + velocity * (velocity[2] + root) / GRAVITY_EARTH
    return bool(landing[0] > CRATE[0])


def stage() -> Stage:
    """Make the stage: bodies in two rows on the floor, and the crate."""
    world = World(friction=0.8)
    _add_crate(world)
    contact = Contact(friction=0.6)
    meshes = [
        sphere(0.36, 3),
        box((0.6, 0.6, 0.6), (4, 4, 4)),
        cylinder(0.34, 0.6, rings=2, layers=4),
        torus(0.34, 0.14, rings=1, segments=18),
    ]
    actors = []
    for i, mesh in enumerate(meshes):
        place = (-0.1 - 1.1 * (i // 2), 0.6 - 1.2 * (i % 2), 0.002 - mesh.bounds[0][2])
        body = world.add_body(mesh, MATERIAL, law="neo_hookean", position=place, contact=contact)
        actors.append(Actor(body, PALETTE[i]))
    world.build()
    frame = world.add_frame((-0.6, 0.0, 2.2))
    props = [Prop(SphereShape(0.09).surface(), frame, color=(0.95, 0.93, 0.88))]
    camera = Camera.framing(
        (-1.5, -1.4, 0.0), (3.7, 1.2, 3.1), aspect=16 / 9, azimuth=-72, elevation=34, margin=1.0
    )
    return Stage("picked up and thrown", world, actors, camera, STEP, 10.0, act=Hand(frame), props=props)


def _add_crate(world: World) -> None:
    """Add the four walls of the crate. The floor is its bottom."""
    reach = (INSIDE + WALL) / 2
    for x, y in ((-1, 0), (1, 0), (0, -1), (0, 1)):
        size = (WALL if x else INSIDE + 2 * WALL, WALL if y else INSIDE, HEIGHT)
        world.add_collider(BoxShape(size), position=CRATE + np.array([x * reach, y * reach, HEIGHT / 2]))


def proof(stage: Stage) -> float:
    """Return the number of bodies whose vertices all lie within the crate's walls."""
    half = np.array([INSIDE / 2 + 0.02, INSIDE / 2 + 0.02])
    return float(sum((np.abs(a.body.positions()[:, :2] - CRATE[:2]) < half).all() for a in stage.actors))


if __name__ == "__main__":
    main("demo", "grab")
