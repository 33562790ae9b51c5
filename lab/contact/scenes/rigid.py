"""Rigid bodies against each other, against soft bodies and against colliders."""

from __future__ import annotations

import numpy as np

from lab.contact.criteria import AtRest, Creep, Finally, MomentumKept, Most, whole
from lab.contact.scene import Scene, Stage
from lab.contact.scenes.bodies import JELLY, rotation
from taichi_soft import (
    BoxShape,
    Contact,
    SoftBodyAsset,
    SpringMaterial,
    World,
    box,
    cloth,
    cloth_constants,
    sphere,
)


def _stack(count: int = 10) -> Stage:
    world = World(floor=0.0)
    edge = 0.5
    crates = [
        world.add_rigid(box((edge,) * 3), mass=10.0, position=(0.01 * (i % 2), 0, edge / 2 + 0.51 * i))
        for i in range(count)
    ]
    lean = Most("lean of the top", lambda: float(np.abs(crates[-1].center_of_mass()[:2]).max()), 0.02, "m")
    return Stage(world, (AtRest(crates, 5.0), Creep(crates, 6.0), lean, whole(crates)))


def _wall() -> Stage:
    """A wall of bricks in a running bond, six rows high."""
    world = World(floor=0.0)
    brick = SoftBodyAsset.rigid(box((0.4, 0.2, 0.2)), mass=5.0, contact=Contact(friction=0.7))
    places = [
        (0.41 * k + (0.205 if row % 2 else 0.0), 0.0, 0.1 + 0.203 * row)
        for row in range(6)
        for k in range(5 - row % 2)
    ]
    world.reserve(brick, len(places))
    bricks = [world.spawn(brick, position=place) for place in places]
    return Stage(world, (AtRest(bricks, 5.0), Creep(bricks, 6.0), whole(bricks)))


def _heap() -> Stage:
    world = World(floor=0.0)
    for x, y, turn in ((0.75, 0, 0), (-0.75, 0, 0), (0, 0.75, 90), (0, -0.75, 90)):
        world.add_collider(
            BoxShape((0.1, 1.6, 1.0)), position=(x, y, 0.5), rotation=rotation((0, 0, 1), turn)
        )
    crate = SoftBodyAsset.rigid(box((0.25, 0.2, 0.15)), mass=2.0)
    world.reserve(crate, 64)
    crates = [
        world.spawn(
            crate,
            position=(0.33 * (i % 4) - 0.5, 0.33 * (i // 4 % 4) - 0.5, 0.2 + 0.3 * (i // 16)),
            rotation=rotation((1, 2, 3), 37.0 * i),
        )
        for i in range(64)
    ]
    inside = Finally(
        "bodies inside the walls",
        lambda: float(sum(np.abs(body.center_of_mass()[:2]).max() < 0.75 for body in crates)),
        64,
        64,
        "",
    )
    return Stage(world, (AtRest(crates, 5.0), Creep(crates, 6.0), inside, whole(crates)))


def _on_jelly(mass: float, crate_is_above: bool) -> Stage:
    world = World(floor=0.0)
    heights = (1.16, 0.5) if crate_is_above else (0.15, 0.81)
    crate = world.add_rigid(box((0.3,) * 3), mass=mass, position=(0, 0, heights[0]))
    jelly = world.add_body(box((1, 1, 1), (5, 5, 5)), JELLY, position=(0, 0, heights[1]))
    lowest = (1.0, 1.16) if crate_is_above else (0.14, 0.16)
    return Stage(
        world,
        (
            Finally("height of the crate", lambda: float(crate.center_of_mass()[2]), *lowest, "m"),
            Finally("drift", lambda: float(np.linalg.norm(crate.center_of_mass()[:2])), 0.0, 0.05, "m"),
            whole([crate, jelly]),
        ),
    )


def _trampoline() -> Stage:
    """A ball falls on a sheet whose springs are stretched by a quarter."""
    world = World(floor=None)
    mesh = cloth((2.0, 2.0), (16, 16), mass=0.2)
    stiffness = cloth_constants(mesh, (16, 16), tensile=1500, shear=750, bend=30)
    rim = np.flatnonzero(np.abs(mesh.vertices[:, :2]).max(axis=1) > 0.999)
    springs = SpringMaterial(stiffness, damping=0.0, rest_length=0.8 * mesh.edge_lengths)
    sheet = world.add_body(mesh, springs, pinned=rim)
    ball = world.add_rigid(sphere(radius=0.15, resolution=3), mass=0.5, position=(0.03, 0.02, 0.5))
    height = Most("height after one second", lambda: float(ball.center_of_mass()[2]), 0.3, "m", after=1.0)
    held = Finally("height at the end", lambda: float(ball.center_of_mass()[2]), 0.0, 0.3, "m")
    return Stage(world, (height, held, whole([sheet, ball])))


def _collision() -> Stage:
    world = World(floor=None, gravity=(0, 0, 0))
    first = world.add_rigid(box((0.4, 0.3, 0.2)), mass=3.0, velocity=(4, 0, 0), angular_velocity=(1, 2, 3))
    second = world.add_rigid(box((0.3,) * 3), mass=1.0, position=(1.0, 0.12, 0.07))
    world.build()
    kept = MomentumKept([first, second], limit=1e-5).begin()
    return Stage(world, (kept, whole([first, second])))


SCENES = (
    Scene("rigid stack", "Ten rigid crates on each other come to rest", 12.0, _stack),
    Scene("brick wall", "A wall of 27 rigid bricks stands", 12.0, _wall),
    Scene("rigid heap", "64 rigid crates fall into a pit", 12.0, _heap),
    Scene(
        "crate on jelly", "A rigid crate of 1 kg lies on a jelly of 500 kg", 3.0, lambda: _on_jelly(1, True)
    ),
    Scene(
        "jelly on crate", "A jelly of 500 kg lies on a rigid crate of 1 kg", 3.0, lambda: _on_jelly(1, False)
    ),
    Scene("trampoline", "A rigid ball bounces on a sheet", 3.0, _trampoline),
    Scene("rigid collision", "Two rigid boxes collide in space", 1.0, _collision),
)
