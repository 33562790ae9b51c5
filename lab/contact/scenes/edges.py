"""Edges, corners and points of solids that meet."""

from __future__ import annotations

import numpy as np

from lab.contact.criteria import Finally, MomentumKept, Most, apart, whole
from lab.contact.scene import Scene, Stage
from lab.contact.scenes.bodies import FIRM, JELLY, RUBBER, bar, moved, rotation, turned, union
from taichi_soft import Body, Contact, World, box

HEIGHT = 0.1 * np.sqrt(2.0)
"""Height of a bar on its edge [m]."""


def _crossed(gravity: float, friction: float = 0.5) -> Stage:
    world = World(gravity=(0, 0, -gravity), floor=None)
    contact = Contact(friction=friction)
    ends = np.flatnonzero(np.abs(bar().vertices[:, 0]) > 0.59)
    lower = world.add_body(bar(), FIRM, pinned=ends, contact=contact)
    across = turned(bar(), (0, 0, 1), 90.0)
    upper = world.add_body(across, FIRM, position=(0, 0, HEIGHT + 0.005), contact=contact)
    return Stage(world, (apart([lower, upper], 0.005, every=1), whole([lower, upper])))


def _bars() -> Stage:
    return _crossed(9.81)


def _pressed_bars() -> Stage:
    return _crossed(981.0)


def _blow() -> Stage:
    world = World(gravity=(0, 0, 0), floor=None)
    first = world.add_body(bar(), RUBBER)
    second = world.add_body(
        turned(bar(), (0, 0, 1), 90.0), RUBBER, position=(0.15, 0.1, HEIGHT + 0.02), velocity=(0.4, 0.3, -3.0)
    )
    world.build()
    bodies = [first, second]
    energy = _energy(bodies)
    return Stage(
        world,
        (
            apart(bodies, 0.005, every=1),
            MomentumKept(bodies).begin(),
            Finally(
                "kinetic energy",
                lambda: _energy(bodies) / energy,
                0.0,
                1.0,
                "of that before",
            ),
        ),
    )


def _energy(bodies: list[Body]) -> float:
    return sum(body.kinetic_energy() for body in bodies)


def _combs() -> Stage:
    world = World(gravity=(0, 0, 0), floor=None)
    teeth = [moved(box((0.06, 0.1, 0.3), (1, 1, 3)), (0.2 * i - 0.4, 0.0, 0.2)) for i in range(5)]
    pieces = [moved(box((0.06, 0.1, 0.1), (1, 1, 1)), (0.2 * i - 0.4, 0.0, 0.0)) for i in range(5)]
    between = [moved(box((0.14, 0.1, 0.1), (1, 1, 1)), (0.2 * i - 0.3, 0.0, 0.0)) for i in range(4)]
    comb = union(*teeth, *pieces, *between)
    first = world.add_body(comb, RUBBER)
    # The second comb comes from above, turned over and shifted by half a tooth and a little.
    second = world.add_body(
        turned(comb, (1, 0, 0), 180.0), RUBBER, position=(0.085, 0.01, 0.8), velocity=(0, 0, -2.0)
    )
    world.build()
    bodies = [first, second]
    return Stage(world, (apart(bodies, 0.005), MomentumKept(bodies).begin(), whole(bodies)))


def _plates() -> Stage:
    world = World(gravity=(0, 0, 0), floor=None)
    plate = box((0.6, 0.6, 0.04), (3, 3, 1))
    first = world.add_body(plate, FIRM)
    second = world.add_body(
        turned(plate, (1, 0, 0), 90.0),
        FIRM,
        position=(0.02, 0.62, 0.01),
        velocity=(0, -4.0, 0),
        rotation=rotation((0, 1, 0), 20.0),
    )
    world.build()
    bodies = [first, second]
    return Stage(world, (apart(bodies, 0.005), MomentumKept(bodies).begin(), whole(bodies)))


def _corner() -> Stage:
    world = World(floor=0.0)
    jelly = world.add_body(box((0.6, 0.6, 0.3), (4, 4, 2)), JELLY, on_floor=True)
    cube = turned(turned(box((0.2, 0.2, 0.2), (2, 2, 2)), (1, 0, 0), 45.0), (0, 1, 0), 35.26)
    dropped = world.add_body(cube, FIRM, position=(0.01, 0.02, 0.7))
    bodies = [jelly, dropped]
    below = Most(
        "corner below the jelly", lambda: 1e3 * (0.0 - float(dropped.positions()[:, 2].min())), 0.0, "mm"
    )
    return Stage(world, (apart(bodies, 0.005), below, whole(bodies)))


def _ridge() -> Stage:
    world = World(floor=0.0)
    jelly = world.add_body(box((0.8, 0.4, 0.2), (4, 2, 1)), JELLY, on_floor=True)
    dropped = world.add_body(turned(bar(), (0, 0, 1), 90.0), FIRM, position=(0.03, 0.0, 0.5))
    return Stage(world, (apart([jelly, dropped], 0.01), whole([jelly, dropped])))


SCENES = (
    Scene("crossed bars", "A bar lies on a bar, edge on edge; no vertex is near.", 0.6, _bars),
    Scene("pressed bars", "The same under 100 times its weight.", 0.15, _pressed_bars),
    Scene("thrown bar", "A bar is thrown across a bar, edge on edge, without gravity.", 1.0, _blow),
    Scene("combs", "Two combs are pushed into each other.", 1.5, _combs),
    Scene("plates", "A plate hits the rim of a plate with its rim.", 0.6, _plates),
    Scene("corner on jelly", "A firm cube falls on a jelly with a corner.", 1.5, _corner),
    Scene("edge on jelly", "A firm bar falls on a coarse jelly with its edge.", 1.5, _ridge),
)
