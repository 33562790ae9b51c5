"""Bodies on colliders: rims, pins, slopes and belts."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lab.contact.criteria import AtRest, Creep, Finally, Most, whole
from lab.contact.scene import Scene, Stage
from lab.contact.scenes.bodies import JELLY, RUBBER, bar, product, rotation, turned
from taichi_soft import Body, BoxShape, CapsuleShape, PlaneShape, World, box, sphere


def _on_rim() -> Stage:
    world = World(floor=None)
    # A shelf whose rim is half way between the vertices of the block.
    world.add_collider(BoxShape((1.0, 1.0, 0.04)), position=(-0.55, 0, 0), friction=1.0)
    block = world.add_body(box((0.6, 0.2, 0.2), (3, 1, 1)), RUBBER, position=(-0.13, 0, 0.2))
    return Stage(world, (_depth_of_edges(block, (1.0, 1.0, 0.04), (-0.55, 0, 0)), whole([block])))


def _on_knife() -> Stage:
    world = World(floor=0.0)
    world.add_collider(
        BoxShape((0.2, 1.0, 0.2)), position=(0.05, 0, 0.3), rotation=rotation((0, 1, 0), 45.0), friction=1.0
    )
    beam = world.add_body(box((1.0, 0.2, 0.1), (4, 1, 1)), RUBBER, position=(0, 0, 0.6))
    depth = Most(
        "depth of the edge", lambda: 1e3 * _sag(beam, 0.05, 0.3 + 0.1 * np.sqrt(2.0)), 10.0, "mm", every=2
    )
    return Stage(world, (depth, whole([beam])))


def _sag(body: Body, x0: float, height: float) -> float:
    """Return how far the edges of a body's surface are below an edge along y at x0 [m]."""
    from lab.contact.geometry import surface_edges

    x = body.positions().astype(np.float64)
    ends = x[surface_edges(body.surface)]
    a, b = ends[:, 0], ends[:, 1]
    meets = (a[:, 0] - x0) * (b[:, 0] - x0) < 0
    t = (x0 - a[meets, 0]) / (b[meets, 0] - a[meets, 0])
    z = a[meets, 2] + t * (b[meets, 2] - a[meets, 2])
    inside = np.abs(a[meets, 1] + t * (b[meets, 1] - a[meets, 1])) < 0.5
    lowest = z[inside].min(initial=np.inf)
    highest = z[inside].max(initial=-np.inf)
    return float(max(height - lowest, 0.0)) if highest > height else 0.0


def _depth_of_edges(body: Body, size: ArrayLike, center: ArrayLike) -> Most:
    """Return the criterion that no point of a body's edges is deeper than 5 mm in a box."""
    from lab.contact.geometry import points_on_edges

    half = 0.5 * np.asarray(size)

    def depth() -> float:
        beside = np.abs(points_on_edges(body) - np.asarray(center))
        return 1e3 * float(np.maximum((half - beside).min(axis=1), 0.0).max())

    return Most("depth in the shelf", depth, 5.0, "mm", every=2)


def _on_pin() -> Stage:
    world = World(floor=0.0)
    world.add_collider(CapsuleShape(radius=0.01, length=0.4), position=(0.03, 0.02, 0.2), friction=1.0)
    block = world.add_body(box((0.4, 0.4, 0.1), (2, 2, 1)), JELLY, position=(0, 0, 0.6))

    def depth() -> float:
        x = block.positions().astype(np.float64)
        corners = x[block.surface]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        low = corners[normal[:, 2] < 0]
        tip = np.array([0.03, 0.02])
        heights = [_height_over(triangle, tip) for triangle in low]
        return 1e3 * max(0.41 - min((h for h in heights if h is not None), default=np.inf), 0.0)

    return Stage(world, (Most("depth of the pin", depth, 10.0, "mm", every=2), whole([block])))


def _height_over(triangle: NDArray[np.float64], point: NDArray[np.float64]) -> float | None:
    """Return the height of a triangle over a point of the plane [m], or None beside the triangle."""
    matrix = np.stack([triangle[1, :2] - triangle[0, :2], triangle[2, :2] - triangle[0, :2]], axis=1)
    if abs(np.linalg.det(matrix)) < 1e-12:
        return None
    s, t = np.linalg.solve(matrix, point - triangle[0, :2])
    if s < 0 or t < 0 or s + t > 1:
        return None
    return float(
        triangle[0, 2] + s * (triangle[1, 2] - triangle[0, 2]) + t * (triangle[2, 2] - triangle[0, 2])
    )


def _slope(degrees: float, friction: float) -> tuple[World, Body]:
    world = World(floor=None)
    normal = np.array([np.sin(np.radians(degrees)), 0, np.cos(np.radians(degrees))])
    world.add_collider(PlaneShape(normal), friction=friction)
    block = world.add_body(
        box((0.3, 0.3, 0.15), (3, 3, 2)),
        RUBBER,
        position=0.078 * normal,
        rotation=rotation((0, 1, 0), degrees),
    )
    world.build()
    return world, block


def _sticks() -> Stage:
    world, block = _slope(20.0, 0.5)
    return Stage(world, (Creep([block], 2.0), whole([block])))


def _slides() -> Stage:
    world, block = _slope(30.0, 0.3)
    begin = np.array(block.center_of_mass())
    seconds = 1.0
    # Coulomb: a = g (sin - mu cos).
    expected = 0.5 * 9.81 * float(np.sin(np.radians(30)) - 0.3 * np.cos(np.radians(30))) * seconds**2

    def way() -> float:
        return float(np.linalg.norm(np.array(block.center_of_mass()) - begin)) / expected

    return Stage(world, (Finally("way over that by Coulomb's law", way, 0.95, 1.05, ""), whole([block])))


def _belt(degrees: float, friction: float) -> Stage:
    """A block on a belt that runs at 1 m/s, uphill if it is tilted: the block reaches that speed."""
    world = World(floor=None)
    turn, speed = rotation((0, 1, 0), degrees), 1.0
    normal = np.array([np.sin(np.radians(degrees)), 0, np.cos(np.radians(degrees))])
    uphill = np.array([-normal[2], 0, normal[0]])
    world.add_collider(
        BoxShape((20.0, 1.0, 0.2)),
        position=-0.1 * normal,
        rotation=turn,
        friction=friction,
        surface_velocity=(-speed, 0.0, 0.0),
    )
    block = world.add_body(box((0.3, 0.3, 0.15), (3, 3, 2)), RUBBER, position=0.078 * normal, rotation=turn)

    def ratio() -> float:
        return float(block.masses @ block.velocities().astype(float) @ uphill / block.masses.sum()) / speed

    return Stage(
        world, (Finally("speed of the block over the belt's", ratio, 0.98, 1.02, ""), whole([block]))
    )


def _turning_drum() -> Stage:
    """A cylinder that turns under a ball: the ball's surface takes over the speed of the drum's."""
    world = World(floor=None)
    drum = world.add_collider(
        CapsuleShape(radius=0.5, length=2.0), rotation=(np.sqrt(0.5), 0, 0, np.sqrt(0.5)), friction=1.0
    )
    left = world.add_collider(BoxShape((0.05, 2.0, 1.5)), position=(-0.28, 0, 0.9), friction=0.0)
    right = world.add_collider(BoxShape((0.05, 2.0, 1.5)), position=(0.28, 0, 0.9), friction=0.0)
    assert left is not right
    ball = world.add_body(sphere(radius=0.2), RUBBER, position=(0, 0, 0.72))
    world.build()
    speed = 1.0  # of the surface [m/s]

    def turn(time: float) -> None:
        angle = speed / 0.5 * (time + 1.0 / 60.0)
        drum.move_to(
            (0, 0, 0),
            product(rotation((0, 1, 0), np.degrees(angle)), np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)])),
        )

    def ratio() -> float:
        x, v = ball.positions().astype(float), ball.velocities().astype(float)
        beside = x - ball.center_of_mass()
        spin = np.linalg.lstsq(
            np.concatenate([_cross_matrix(row) for row in beside]), (v - v.mean(axis=0)).ravel(), rcond=None
        )[0]
        return float(-spin[1] * 0.2 / speed)

    return Stage(
        world,
        (Finally("speed of the ball's surface over the drum's", ratio, 0.9, 1.1, ""), whole([ball])),
        turn,
    )


def _cross_matrix(row: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y, z = row
    return np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])


def _bar_on_bar() -> Stage:
    """A soft bar falls across the edge of a box collider; no vertex of the bar is near."""
    world = World(floor=None)
    world.add_collider(BoxShape((1.2, 0.1, 0.1)), rotation=rotation((1, 0, 0), 45.0), friction=1.0)
    across = turned(bar(), (0, 0, 1), 90.0)
    body = world.add_body(across, RUBBER, position=(0.03, 0.0, 0.2))
    fall = Most("fall of the middle", lambda: -float(np.median(body.positions()[:, 2])), 0.0, "m")
    return Stage(world, (fall, whole([body])))


def _rests() -> Stage:
    world = World(floor=0.0)
    block = world.add_body(box((0.3, 0.3, 0.3), (3, 3, 3)), JELLY, position=(0, 0, 0.4))
    return Stage(world, (AtRest([block], 5.0), Creep([block], 6.0), whole([block])))


SCENES = (
    Scene("block on the floor", "A soft block falls on the floor.", 8.0, _rests),
    Scene("block on a rim", "A block falls on the rim of a shelf, between its vertices.", 1.0, _on_rim),
    Scene("beam on an edge", "A beam falls on the edge of a box, between its vertices.", 1.0, _on_knife),
    Scene("block on a pin", "A block falls on a pin, inside a triangle.", 1.0, _on_pin),
    Scene("bar on a box's edge", "A bar on its edge falls on the edge of a box.", 0.6, _bar_on_bar),
    Scene("sticks on a slope", "A block lies on a slope of 20 degrees, friction 0.5.", 6.0, _sticks),
    Scene("slides on a slope", "A block slides on a slope of 30 degrees, friction 0.3.", 1.0, _slides),
    Scene("block on a belt", "A block lies on a conveyor belt.", 3.0, lambda: _belt(0.0, 0.3)),
    Scene(
        "belt uphill", "A belt of 20 degrees, friction 0.8, carries a block.", 4.0, lambda: _belt(20.0, 0.8)
    ),
    Scene("ball on a drum", "A ball lies on a drum that turns.", 4.0, _turning_drum),
)
