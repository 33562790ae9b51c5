"""Fast bodies, thin walls, and bodies that start inside each other."""

from __future__ import annotations

import numpy as np

from lab.contact.criteria import Finally, MomentumKept, Most, apart, whole
from lab.contact.scene import Scene, Stage
from lab.contact.scenes.bodies import FIRM, RUBBER
from taichi_soft import Body, Material, World, box, sphere

HARD = Material(young=5e7, poisson=0.3, density=1000.0)


def _separation(first: Body, second: Body, axis: int = 0) -> float:
    """Return how far the second body's centre is beyond the first body's centre along an axis [m]."""
    return float(second.center_of_mass()[axis] - first.center_of_mass()[axis])


def _balls(speed: float) -> Stage:
    world = World(gravity=(0, 0, 0), floor=None)
    ball = sphere(radius=0.2, resolution=3)
    first = world.add_body(ball, HARD, position=(0, 0, 0))
    second = world.add_body(ball, HARD, position=(2.0, 0.03, 0.02), velocity=(-speed, 0, 0))
    world.build()
    bodies = [first, second]
    side = Finally("side of the second ball", lambda: _separation(first, second), 0.0, np.inf, "m")
    return Stage(world, (side, MomentumKept(bodies).begin(), whole(bodies)))


def _balls_50() -> Stage:
    return _balls(50.0)


def _balls_200() -> Stage:
    return _balls(200.0)


def _wall(speed: float) -> Stage:
    world = World(gravity=(0, 0, 0), floor=None)
    mesh = box((0.02, 1.0, 1.0), (1, 10, 10))
    border = np.flatnonzero(np.abs(mesh.vertices[:, 1:]).max(axis=1) > 0.49)
    wall = world.add_body(mesh, HARD, pinned=border)
    ball = world.add_body(
        sphere(radius=0.1, resolution=3), RUBBER, position=(1.0, 0.02, 0.01), velocity=(-speed, 0, 0)
    )
    side = Most("way beyond the wall", lambda: -_separation(wall, ball), 0.2, "m")
    return Stage(world, (side, whole([wall, ball])))


def _wall_30() -> Stage:
    return _wall(30.0)


def _wall_100() -> Stage:
    return _wall(100.0)


def _pressed() -> Stage:
    world = World(floor=0.0)
    lower = world.add_body(box((0.3, 0.3, 0.2), (3, 3, 2)), FIRM, on_floor=True)
    upper = world.add_body(box((0.3, 0.3, 0.2), (3, 3, 2)), FIRM, position=(0.02, 0.01, 0.31))
    weight = 9.81 * float(upper.masses.sum())
    top = np.flatnonzero(upper.mesh.vertices[:, 2] > 0.09)

    def press(time: float) -> None:
        upper.apply_force((0, 0, -100.0 * weight * min(time, 1.0)), particles=top)

    bodies = [lower, upper]
    return Stage(world, (apart(bodies, 0.005, every=10), whole(bodies)), press)


def _overlapping() -> Stage:
    world = World(gravity=(0, 0, 0), floor=None)
    first = world.add_body(box((0.4, 0.4, 0.4), (3, 3, 3)), RUBBER)
    second = world.add_body(box((0.4, 0.4, 0.4), (3, 3, 3)), RUBBER, position=(0.15, 0.1, 0.2))
    bodies = [first, second]
    speed = Most(
        "fastest vertex", lambda: max(float(np.abs(b.velocities()).max()) for b in bodies), 2.0, "m/s"
    )
    world.build()
    end = Finally("overlap at the end", lambda: 1e3 * _overlap(first, second), 0.0, 5.0, "mm")
    return Stage(world, (speed, end, whole(bodies)))


def _overlap(first: Body, second: Body) -> float:
    from lab.contact.geometry import overlap

    return overlap(first, second)


def _squeezed() -> Stage:
    from taichi_soft import CapsuleShape

    world = World(floor=None, gravity=(0, 0, 0))
    # A tube of twelve capsules along x, narrower than the body.
    for i in range(12):
        angle = 2 * np.pi * i / 12
        world.add_collider(
            CapsuleShape(radius=0.1, length=1.0),
            position=(0.5, 0.3 * np.cos(angle), 0.3 * np.sin(angle)),
            rotation=(0, np.sqrt(0.5), 0, np.sqrt(0.5)),
            friction=0.1,
        )
    ball = world.add_body(
        sphere(radius=0.25), Material(young=5e4, poisson=0.4, density=1000.0), position=(-0.6, 0, 0)
    )

    def push(time: float) -> None:
        ball.apply_force((4000.0, 0, 0))

    out = Finally("way of the ball", lambda: float(ball.center_of_mass()[0]), 1.2, np.inf, "m")
    wide = Most(
        "distance from the axis inside the tube",
        lambda: _widest(ball),
        0.32,
        "m",
    )
    return Stage(world, (out, wide, whole([ball])), push)


def _widest(ball: Body) -> float:
    """Return the largest distance of a vertex inside the tube from its axis [m]."""
    x = ball.positions()
    inside = x[(x[:, 0] > 0.1) & (x[:, 0] < 0.9)]
    return float(np.linalg.norm(inside[:, 1:], axis=1).max(initial=0.0))


SCENES = (
    Scene("balls at 50 m/s", "A ball hits a ball at 50 m/s.", 0.5, _balls_50),
    Scene("balls at 200 m/s", "A ball hits a ball at 200 m/s.", 0.5, _balls_200),
    Scene("wall at 30 m/s", "A ball hits a clamped wall of 2 cm at 30 m/s.", 0.5, _wall_30),
    Scene("wall at 100 m/s", "A ball hits a clamped wall of 2 cm at 100 m/s.", 0.5, _wall_100),
    Scene("pressed", "A block is pressed on a block with 100 times its weight.", 10.0, _pressed),
    Scene("overlap", "Two blocks start inside each other.", 3.0, _overlapping),
    Scene(
        "squeezed through a tube",
        "A soft ball is pushed through a tube that is narrower than the ball.",
        4.0,
        _squeezed,
    ),
)
