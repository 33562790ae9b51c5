"""A character walks over steps and a soft bridge, and is carried by a block of jelly.

The bridge sags below the character. The jelly sways under it and takes it along. The class `Character` is a
complete character controller, made of shape casts: copy it into your game.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from engine_adapter import FixedStep
from taichi_soft import Body, BoxShape, CapsuleShape, Frame, Material, ShapeHit, World, box
from taichi_soft.cli import main
from taichi_soft.core.constants import GRAVITY_EARTH
from taichi_soft.render import PALETTE, Camera
from taichi_soft.render.film import Actor, Stage
from taichi_soft.render.props import Prop

Vector = NDArray[np.float64]

RADIUS, LENGTH = 0.3, 0.7  # of the capsule; its height is LENGTH + 2 RADIUS [m]
MASS, SPEED = 70.0, 1.1  # [kg], [m/s]
STAIR = 0.3  # height of steps that it climbs and descends without falling [m]
SKIN = 0.01  # distance that it keeps from surfaces [m]
STEEPEST = 0.6  # smallest z of the normal of a surface on which it can stand
UP = np.array([0.0, 0.0, 1.0])

DECK = 0.9  # height of the bridge and of the jelly [m]
BRIDGE = (-1.5, 2.0)  # x of its ends [m]
RAFT = np.array([3.04, 0.0, 0.0])  # centre of the jelly's bottom [m]
SIZE = (1.6, 1.6, DECK)  # edges of the jelly [m]
LEAVE, TRAVEL, WAY = 8.0, 3.0, 2.6  # the jelly starts [s], travels for [s], by [m]
STEP = FixedStep(dt=1 / 50)


class Character:
    """A capsule that walks, falls, climbs steps, stands on colliders and bodies, and presses bodies down."""

    def __init__(self, world: World, position: Vector) -> None:
        """Start in the air, at the position of the capsule's centre."""
        self.world, self.shape = world, CapsuleShape(RADIUS, LENGTH)
        self.position, self.rise = np.array(position, dtype=float), 0.0  # [m], upward speed in the air [m/s]
        self.ground: ShapeHit | None = None  # the surface on which it stands

    def move(self, velocity: Vector, dt: float) -> None:
        """Walk for a step with a horizontal velocity [m/s]. Call this before each step of the world."""
        if self.ground is not None:
            self.position += self._carried()
        self._slide(velocity * dt)
        # Search for ground below, from the top of the highest step that it climbs.
        lifted = self._reach(UP, STAIR)
        below = self._cast(self.position + lifted * UP, -UP, lifted + STAIR + SKIN)
        falls = self.ground is None and (self.rise > 0.0 or below is None or below.distance > lifted + SKIN)
        if below is None or falls or below.normal[2] < STEEPEST:
            self.rise -= GRAVITY_EARTH * dt
            self._fall(self.rise * dt)
            return
        self.position[2] += lifted + below.depth - max(below.distance - SKIN, 0.0)
        self.ground = below
        # Its weight, and the momentum of a landing, act on a body around the point where it stands.
        if isinstance(below.body, Body):
            impulse = MASS * (min(self.rise, 0.0) - GRAVITY_EARTH * dt)
            below.body.apply_impulse_at_point(impulse * UP, below.point, 2.0 * RADIUS)
        self.rise = 0.0

    def jump(self, speed: float) -> None:
        """Leave the ground at an upward speed [m/s]."""
        if self.ground is not None:
            self.ground, self.rise = None, speed

    def _carried(self) -> Vector:
        """Return the displacement in the last step of the point on which it stands [m]."""
        ground, dt = self.ground, self.world.last_dt
        assert ground is not None
        if ground.collider is not None:
            collider = ground.collider
            arm = ground.point - collider.position
            return dt * (collider.velocity + np.cross(collider.angular_velocity, arm))
        assert ground.body is not None
        if not ground.body.is_alive:
            return np.zeros(3)
        shift = ground.barycentrics @ ground.body.positions()[ground.vertices] - ground.point
        return np.array([shift[0], shift[1], 0.0])  # the search for ground follows its height

    def _slide(self, path: Vector) -> None:
        """Move along a path, and along the surfaces that are in the way."""
        for _ in range(3):
            length = float(np.linalg.norm(path))
            if length < 1e-6:
                return
            hit = self._cast(self.position, path, length + SKIN)
            if hit is None:
                self.position += path
                return
            if hit.depth > 0.0:
                self.position += hit.depth * hit.normal
            elif (stair := self._climb(path)) is not None:
                self.position = stair
                return
            ahead = min(max(hit.distance - SKIN, 0.0), length)
            self.position += ahead / length * path
            rest = (1.0 - ahead / length) * path
            wall = hit.normal if hit.normal[2] > STEEPEST else hit.normal * (1, 1, 0)
            path = rest - rest @ wall / max(wall @ wall, 1e-9) * wall

    def _climb(self, path: Vector) -> Vector | None:
        """Return the position above a step at the end of a path, None if there is no step to stand on."""
        lifted = self.position + self._reach(UP, STAIR) * UP
        ahead = path + RADIUS * path / np.linalg.norm(path)
        if self._cast(lifted, ahead, float(np.linalg.norm(ahead))) is not None:
            return None
        below = self._cast(lifted + ahead, -UP, STAIR)
        return lifted + path if below is not None and below.normal[2] > STEEPEST else None

    def _fall(self, way: float) -> None:
        """Move up or down in the air by `way` [m], until something is in the way."""
        self.ground = None
        self.position[2] += np.sign(way) * self._reach(np.sign(way) * UP, abs(way))

    def _reach(self, direction: Vector, way: float) -> float:
        """Return how far it can move along a unit vector, at most by `way` [m]."""
        hit = self._cast(self.position, direction, way + SKIN)
        return way if hit is None else max(hit.distance - SKIN, 0.0)

    def _cast(self, start: Vector, direction: Vector, way: float) -> ShapeHit | None:
        return self.world.shapecast(self.shape, start, direction, max_distance=way)


class Walk:
    """Walks the character along the course, and moves the jelly when the character stands on it."""

    def __init__(self, character: Character, figure: Frame, raft: Frame) -> None:
        """Start at the beginning of the course."""
        self.character, self.figure, self.raft = character, figure, raft

    def __call__(self, world: World) -> None:
        """Move the character and the jelly before a step."""
        t = min(max((world.time - LEAVE) / TRAVEL, 0.0), 1.0)
        travelled = WAY * (t - np.sin(2 * np.pi * t) / (2 * np.pi))
        self.raft.move_to(RAFT + np.array([0.0, travelled, 0.0]))
        arrived = self.character.position[0] > RAFT[0] - 0.02
        self.character.move(np.array([0.0 if arrived else SPEED, 0.0, 0.0]), STEP.dt)
        self.figure.move_to(self.character.position)


def stage() -> Stage:
    """Make the stage: steps, a bridge with pinned ends, a shore, and the jelly."""
    world = World(friction=0.8)
    for i in range(3):
        height = DECK / 3 * (i + 1)
        world.add_collider(
            BoxShape((0.5, 1.6, height)), position=(BRIDGE[0] - 1.27 + 0.5 * i, 0.0, height / 2)
        )
    world.add_collider(BoxShape((0.2, 1.6, DECK)), position=(BRIDGE[1] + 0.11, 0.0, DECK / 2))
    deck = box((BRIDGE[1] - BRIDGE[0], 1.2, 0.16), (18, 6, 1))
    plank = Material(young=1.2e6, poisson=0.3, density=250.0, damping_ratio=0.2)
    bridge = world.add_body(deck, plank, position=(sum(BRIDGE) / 2, 0.0, DECK - 0.08))
    jelly = Material(young=2.2e4, poisson=0.4, density=400.0, damping_ratio=0.12)
    block = world.add_body(box(SIZE, (6, 6, 4)), jelly, position=RAFT + DECK / 2 * UP + 0.01 * UP)
    world.build()
    x = deck.vertices[:, 0]
    bridge.pin(np.flatnonzero(np.abs(x) > x.max() - 0.15))
    raft, figure = world.add_frame(RAFT), world.add_frame((-4.2, 0.0, 0.8))
    z = block.mesh.vertices[:, 2]
    block.attach(np.flatnonzero(z < z.min() + 0.01), raft)
    character = Character(world, figure.position)
    actors = [Actor(bridge, PALETTE[7]), Actor(block, PALETTE[2])]
    props = [Prop(character.shape.surface(), figure, color=PALETTE[0])]
    camera = Camera.framing(
        (-4.0, -0.9, 0.0), (3.9, 2.9, 2.2), aspect=16 / 9, azimuth=-64, elevation=20, margin=1.0
    )
    act: Callable[[World], None] = Walk(character, figure, raft)
    return Stage("a walk over jelly", world, actors, camera, STEP, 13.0, act=act, props=props)


def proof(stage: Stage) -> float:
    """Return the horizontal distance of the character from the middle of the jelly's top [m]."""
    walk = stage.act
    assert isinstance(walk, Walk)
    block = stage.actors[1].body
    z = block.mesh.vertices[:, 2]
    middle = block.positions()[z > z.max() - 0.01].mean(axis=0)
    return float(np.linalg.norm((walk.character.position - middle)[:2]))


if __name__ == "__main__":
    main("demo", "walk")
