"""Rods: hoses and cables that bend and twist."""

from __future__ import annotations

import numpy as np

from lab.contact.criteria import Finally, Most, whole
from lab.contact.geometry import rope_distance
from lab.contact.scene import Scene, Stage
from taichi_soft import CapsuleShape, Contact, RodMaterial, World, rod

RADIUS = 0.01
"""Radius of all hoses [m]."""

HOSE = RodMaterial(2e6, 0.45, 1100, RADIUS, 0.007, damping=0.1, bending_damping=2e-3, torsion_damping=2e-4)
SOFT = RodMaterial(2e5, 0.45, 1100, RADIUS, 0.007, damping=0.1, bending_damping=5e-3)
"""Material of a hose that hangs down at both sides of what it lies on."""


def _over() -> Stage:
    world = World(floor=None)
    mesh = rod(1.2, 40)
    line = world.add_body(mesh, HOSE, pinned=[0, 1, 39, 40], contact=Contact(friction=1.0))
    grip = Contact(friction=1.0)
    other = world.add_body(
        mesh, SOFT, position=(0.03, 0.01, 0.05), rotation=(0, 0, np.sqrt(0.5), np.sqrt(0.5)), contact=grip
    )
    world.build()
    for each in (line, other):
        each.set_linear_damping(2.0)
    overlap = Most("overlap", lambda: 1e3 * (2 * RADIUS - rope_distance(line, other)), 1e3 * RADIUS, "mm")
    hangs = Finally(
        "highest point over the line's lowest",
        lambda: float(other.positions()[:, 2].max() - line.positions()[:, 2].min()),
        0.0,
        np.inf,
        "m",
    )
    return Stage(world, (overlap, hangs, whole([line, other])))


def _over_drum() -> Stage:
    """A cable falls across a drum. It bends over it, and stays at its own radius from the drum."""
    radius = 0.15
    world = World(floor=None)
    cable = world.add_body(rod(1.6, 60), HOSE, position=(0.02, 0, 0.3))
    world.add_collider(
        CapsuleShape(radius=radius, length=1.0),
        rotation=(np.sqrt(0.5), 0, 0, np.sqrt(0.5)),
        friction=0.8,
        thickness=RADIUS,
    )

    def depth() -> float:
        x = cable.positions().astype(float)
        middle = np.concatenate([x, 0.5 * (x[1:] + x[:-1])])
        return 1e3 * float((radius + RADIUS - np.linalg.norm(middle[:, [0, 2]], axis=1)).max())

    falls = Most("fall below the drum", lambda: -float(cable.positions()[:, 2].max()), 0.0, "m")
    return Stage(world, (Most("overlap", depth, 1e3 * RADIUS / 2, "mm"), falls, whole([cable])))


def _plectoneme() -> Stage:
    """The ends of a hose turn against each other and approach, so that it winds around itself."""
    world = World(floor=None, gravity=(0, 0, 0))
    count, length = 60, 1.2
    hose = world.add_body(rod(length, count), HOSE, contact=Contact(itself=True, friction=0.1))
    left, right = world.add_frame(), world.add_frame()
    world.build()
    hose.attach([0, 1], left)
    hose.attach([count - 1, count], right)
    hose.set_linear_damping(2.0)

    def wind(time: float) -> None:
        turns, shift = min(time, 4.0), 0.08 * min(max(time - 2.0, 0.0), 2.0)
        for frame, sign in ((left, 1.0), (right, -1.0)):
            half = np.pi * turns * sign
            frame.move_to((sign * shift, 0, 0), (np.sin(half), 0, 0, np.cos(half)))

    overlap = Most(
        "overlap", lambda: 1e3 * (2 * RADIUS - rope_distance(hose, hose, 3)), 1e3 * RADIUS, "mm", every=4
    )
    loop = Finally(
        "distance from the axis",
        lambda: float(np.linalg.norm(hose.positions()[:, 1:], axis=1).max()),
        0.08,
        0.6,
        "m",
    )
    return Stage(world, (overlap, loop, whole([hose])), wind)


SCENES = (
    Scene("hose over hose", "A hose falls across another one and bends over it.", 3.0, _over),
    Scene("cable over a drum", "A cable falls across a drum and stays on it.", 3.0, _over_drum),
    Scene(
        "twisted hose",
        "The ends of a hose turn eight times against each other and approach: it winds around itself.",
        6.0,
        _plectoneme,
    ),
)
