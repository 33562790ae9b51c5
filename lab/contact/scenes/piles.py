"""Stacks and heaps that come to rest."""

from __future__ import annotations

import numpy as np

from lab.contact.criteria import AtRest, Creep, Finally, Most, apart, whole
from lab.contact.scene import Scene, Stage
from lab.contact.scenes.bodies import FIRM, JELLY, RUBBER, product, rotation
from taichi_soft import BoxShape, Contact, Material, World, box, sphere, torus

STIFF_JELLY = Material(young=5e6, poisson=0.4, density=500.0)
"""Stiff enough that a column of ten cubes does not buckle: Greenhill (1881) requires 1.5e6 Pa."""


def _stack(count: int = 10) -> Stage:
    world = World(floor=0.0)
    edge = 0.2
    bodies = [
        world.add_body(box((edge,) * 3, (2, 2, 2)), STIFF_JELLY, position=(0, 0, (i + 0.5) * (edge + 0.002)))
        for i in range(count)
    ]
    lean = Most(
        "lean of the top",
        lambda: float(np.linalg.norm(bodies[-1].center_of_mass()[:2])),
        0.05,
        "m",
    )
    return Stage(
        world, (AtRest(bodies, 5.0), Creep(bodies, 6.0), lean, apart(bodies, 0.005, every=30), whole(bodies))
    )


def _leaning() -> Stage:
    world = World(floor=0.0)
    edge = 0.2
    bodies = [
        world.add_body(
            box((edge,) * 3, (2, 2, 2)), STIFF_JELLY, position=(0.07 * i, 0, (i + 0.5) * (edge + 0.002))
        )
        for i in range(2)
    ]
    return Stage(world, (AtRest(bodies, 5.0), Creep(bodies, 6.0), whole(bodies)))


def _heap() -> Stage:
    world = World(floor=0.0)
    for x, y, turn in ((0.75, 0, 0), (-0.75, 0, 0), (0, 0.75, 90), (0, -0.75, 90)):
        world.add_collider(
            BoxShape((0.1, 1.6, 1.0)), position=(x, y, 0.5), rotation=rotation((0, 0, 1), turn)
        )
    rng = np.random.default_rng(0)
    bodies = [
        world.add_body(
            sphere(radius=0.15, resolution=2),
            JELLY,
            position=(
                0.35 * (i % 4) - 0.52 + rng.uniform(-0.01, 0.01),
                0.35 * (i // 4 % 4) - 0.52,
                0.2 + 0.35 * (i // 16),
            ),
        )
        for i in range(64)
    ]
    return Stage(
        world, (AtRest(bodies, 5.0), Creep(bodies, 6.0), apart(bodies, 0.01, every=60), whole(bodies))
    )


def _bowl() -> Stage:
    world = World(floor=0.0)
    for i in range(8):
        turn = 45.0 * i
        x, y = np.cos(np.radians(turn)), np.sin(np.radians(turn))
        # Eight slabs that lean outwards by 45 degrees.
        slab = rotation((0, 0, 1), turn)
        lean = rotation((0, 1, 0), 45.0)
        world.add_collider(
            BoxShape((0.05, 0.9, 1.0)), position=(0.55 * x, 0.55 * y, 0.4), rotation=product(slab, lean)
        )
    bodies = [
        world.add_body(
            sphere(radius=0.12, resolution=2),
            RUBBER,
            position=(0.1 * np.cos(i), 0.1 * np.sin(i), 1.2 + 0.3 * i),
        )
        for i in range(8)
    ]
    return Stage(
        world, (AtRest(bodies, 5.0), Creep(bodies, 6.0), apart(bodies, 0.01, every=30), whole(bodies))
    )


def _cards() -> Stage:
    """Two leaning cards with a card on top of each pair, as the first storey of a card house."""
    world = World(floor=0.0)
    lean, length = 12.0, 0.4
    contact = Contact(friction=0.9)
    card = box((0.02, 0.3, length), (1, 3, 4))
    height, half = 0.5 * length * np.cos(np.radians(lean)), 0.5 * length * np.sin(np.radians(lean))
    bodies = []
    for pair in range(2):
        for side in (-1, 1):
            bodies.append(
                world.add_body(
                    card,
                    FIRM,
                    position=(0.45 * pair + side * (half + 0.012), 0, height + 0.006),
                    rotation=rotation((0, 1, 0), -side * lean),
                    contact=contact,
                )
            )
    roof = box((0.6, 0.3, 0.02), (6, 3, 1))
    bodies.append(world.add_body(roof, FIRM, position=(0.225, 0, 2 * height + 0.03), contact=contact))
    stands = Finally(
        "height of the roof", lambda: float(bodies[-1].center_of_mass()[2]), 2 * height - 0.02, 9.0, "m"
    )
    return Stage(world, (stands, apart(bodies, 0.005, every=30), whole(bodies)))


def _rings() -> Stage:
    world = World(floor=0.0)
    ring = torus(0.2, 0.05, rings=1, segments=16)
    bodies = [
        world.add_body(
            ring,
            RUBBER,
            position=(0.05 * np.sin(3 * i), 0.05 * np.cos(5 * i), 0.1 + 0.16 * i),
            rotation=rotation((np.sin(i), np.cos(i), 0), 15.0),
        )
        for i in range(10)
    ]
    return Stage(world, (AtRest(bodies, 10.0), apart(bodies, 0.005, every=30), whole(bodies)))


def _light_on_heavy() -> Stage:
    world = World(floor=0.0)
    heavy = world.add_body(
        box((0.8, 0.8, 0.78), (4, 4, 4)), Material(young=1e5, poisson=0.4, density=1000.0), on_floor=True
    )
    light = world.add_body(
        box((0.1, 0.1, 0.1), (1, 1, 1)),
        Material(young=1e5, poisson=0.3, density=1000.0),
        position=(0.05, 0, 0.9),
    )
    bodies = [heavy, light]
    return Stage(
        world, (AtRest(bodies, 5.0), Creep(bodies, 6.0), apart(bodies, 0.01, every=10), whole(bodies))
    )


def _heavy_on_light() -> Stage:
    world = World(floor=0.0)
    light = world.add_body(
        box((0.3, 0.3, 0.1), (3, 3, 1)), Material(young=1e6, poisson=0.3, density=111.0), on_floor=True
    )
    heavy = world.add_body(
        box((0.3, 0.3, 0.3), (2, 2, 2)),
        Material(young=5e6, poisson=0.3, density=3700.0),
        position=(0.01, 0, 0.26),
    )
    bodies = [light, heavy]
    return Stage(
        world, (AtRest(bodies, 5.0), Creep(bodies, 6.0), apart(bodies, 0.01, every=10), whole(bodies))
    )


def _far(distance: float) -> Stage:
    world = World(floor=0.0)
    cube = world.add_body(box((0.1,) * 3, (2, 2, 2)), RUBBER, position=(distance, 0, 0.06))
    other = world.add_body(box((0.1,) * 3, (2, 2, 2)), RUBBER, position=(distance, 0, 0.18))
    bodies = [cube, other]
    noise = Most(
        "fastest vertex",
        lambda: max(float(np.abs(body.velocities()).max()) for body in bodies),
        0.01,
        "m/s",
        after=3.0,
    )
    return Stage(world, (AtRest(bodies, 5.0), noise, whole(bodies)))


def _at_1_km() -> Stage:
    return _far(1e3)


def _at_20_km() -> Stage:
    return _far(2e4)


SCENES = (
    Scene("stack of ten", "Ten soft cubes stand on each other.", 12.0, _stack),
    Scene("stack off centre", "A cube stands on another, off its centre.", 12.0, _leaning),
    Scene("heap of 64", "64 soft balls fall into a box.", 8.0, _heap),
    Scene("balls in a bowl", "Eight balls fall into a bowl of slabs.", 8.0, _bowl),
    Scene("card house", "A roof lies on two pairs of leaning cards.", 3.0, _cards),
    Scene("pile of rings", "Ten rings fall on each other.", 12.0, _rings),
    Scene("light on heavy", "A cube of 1 kg falls on a block of 500 kg.", 8.0, _light_on_heavy),
    Scene("heavy on light", "A block of 100 kg falls on a plate of 1 kg.", 8.0, _heavy_on_light),
    Scene("at 1 km", "Two cubes of 10 cm fall on each other, 1 km from the origin.", 7.0, _at_1_km),
    Scene("at 20 km", "Two cubes of 10 cm fall on each other, 20 km from the origin.", 7.0, _at_20_km),
)
