"""Cloth."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lab.contact.criteria import Finally, Most, whole
from lab.contact.scene import Scene, Stage
from lab.contact.scenes.bodies import FIRM, RUBBER
from taichi_soft import (
    Body,
    BoxShape,
    Contact,
    ParticleMesh,
    SpringMaterial,
    World,
    box,
    cloth,
    cloth_constants,
    rope,
    sphere,
)

THICKNESS = 0.01
"""Thickness of all cloth [m]."""


def _fabric(cells: tuple[int, int], mesh: ParticleMesh) -> SpringMaterial:
    constants = cloth_constants(mesh, cells, tensile=400.0, shear=100.0, bend=2.0)
    return SpringMaterial(constants, damping=0.05)


def _add_cloth(world: World, size: float = 1.2, count: int = 16, **options: Any) -> Body:
    cells = count, count
    mesh = cloth((size, size), cells, mass=0.3 * size * size)
    options = {"contact": Contact(thickness=THICKNESS, friction=0.5)} | options
    return world.add_body(mesh, _fabric(cells, mesh), **options)


def _on_corner() -> Stage:
    world = World(floor=0.0)
    world.add_collider(BoxShape((0.5, 0.5, 0.5)), position=(0, 0, 0.5))
    sheet = _add_cloth(world, position=(0.3, 0.3, 1.05))
    inside = Most(
        "depth in the box", lambda: 1e3 * _depth_in_box(sheet, 0.25, (0, 0, 0.5)), 10.0, "mm", every=4
    )
    return Stage(world, (inside, whole([sheet])))


def _depth_in_box(sheet: Body, half: float, center: ArrayLike) -> float:
    """Return the largest depth of the middles of the cloth's triangles in a cube [m]."""
    x = sheet.positions().astype(np.float64)
    middles = x[sheet.surface].mean(axis=1) - np.asarray(center)
    return float(np.maximum(half - np.abs(middles).max(axis=1), 0.0).max())


def _on_ball() -> Stage:
    world = World(floor=0.0)
    ball = world.add_body(sphere(radius=0.3), RUBBER, on_floor=True)
    sheet = _add_cloth(world, position=(0, 0, 0.7))
    top = Finally("height of the cloth", lambda: float(sheet.positions()[:, 2].max()), 0.5, np.inf, "m")
    return Stage(world, (top, whole([ball, sheet])))


def _on_cloth() -> Stage:
    world = World(floor=0.0)
    ball = world.add_body(sphere(radius=0.3), RUBBER, on_floor=True)
    lower = _add_cloth(world, position=(0, 0, 0.7))
    upper = _add_cloth(world, position=(0.02, 0.01, 0.9), rotation=(0, 0, np.sin(0.4), np.cos(0.4)))

    def below() -> float:
        """Number of vertices of the upper cloth that are below the lower one, over the ball."""
        x, y = lower.positions().astype(float), upper.positions().astype(float)
        near = np.linalg.norm(y[:, :2], axis=1) < 0.2
        gaps = [p[2] - x[np.argmin(np.linalg.norm(x[:, :2] - p[:2], axis=1)), 2] for p in y[near]]
        return float(sum(gap < -0.02 for gap in gaps))

    return Stage(
        world, (Finally("vertices below the lower cloth", below, 0.0, 0.0, ""), whole([ball, lower, upper]))
    )


def _ball_in_net() -> Stage:
    world = World(floor=0.0)
    cells = 10, 10
    net = cloth((1.2, 1.2), cells, mass=0.4)
    border = np.flatnonzero(np.abs(net.vertices[:, :2]).max(axis=1) > 0.59)
    sheet = world.add_body(
        net, _fabric(cells, net), position=(0, 0, 1.0), pinned=border, contact=Contact(thickness=0.02)
    )
    ball = world.add_body(sphere(radius=0.2), FIRM, position=(0, 0, 1.5))
    fall = Most("fall of the ball below the net", lambda: 0.3 - float(ball.center_of_mass()[2]), 0.0, "m")
    return Stage(world, (fall, whole([sheet, ball])))


def _flag() -> Stage:
    world = World(floor=None)
    pole = world.add_body(
        box((0.06, 0.06, 2.0), (1, 1, 10)), FIRM, pinned=range(0, 44), contact=Contact(friction=0.3)
    )
    sheet = _add_cloth(world, 0.8, 12, position=(0.5, 0, 0.4), rotation=(np.sqrt(0.5), 0, 0, np.sqrt(0.5)))
    side = np.flatnonzero(sheet.mesh.vertices[:, 0] < -0.39)
    sheet_pins = side[[0, -1]]
    world.build()
    sheet.pin(sheet_pins)
    world.set_wind((-6.0, 2.0, 0.0))  # against the pole
    through = Most("fastest vertex", lambda: float(np.abs(sheet.velocities()).max()), 30.0, "m/s")
    return Stage(world, (through, whole([pole, sheet])))


def _rod_on_cloth() -> Stage:
    world = World(floor=None)
    cells = 12, 12
    mesh = cloth((1.2, 1.2), cells, mass=0.4)
    border = np.flatnonzero(np.abs(mesh.vertices[:, :2]).max(axis=1) > 0.59)
    sheet = world.add_body(mesh, _fabric(cells, mesh), pinned=border, contact=Contact(thickness=THICKNESS))
    line = world.add_body(
        rope(0.6, 12, 0.5),
        SpringMaterial(2000.0, 0.5),
        position=(0.02, 0.03, 0.2),
        contact=Contact(thickness=0.02),
    )
    fall = Most(
        "fall below the cloth",
        lambda: float(sheet.positions()[:, 2].min() - line.positions()[:, 2].min()),
        0.02,
        "m",
    )
    return Stage(world, (fall, whole([sheet, line])))


SCENES = (
    Scene("cloth on a corner", "Cloth falls on the corner of a box.", 2.0, _on_corner),
    Scene("cloth on a ball", "Cloth falls on a soft ball.", 2.0, _on_ball),
    Scene("cloth on cloth", "A second cloth falls on the cloth on a ball.", 2.0, _on_cloth),
    Scene("ball in a net", "A ball falls into a net that is held at its border.", 2.0, _ball_in_net),
    Scene("flag", "Wind blows a flag against its pole.", 3.0, _flag),
    Scene("rope on cloth", "A rope falls on a stretched cloth.", 2.0, _rod_on_cloth),
)
