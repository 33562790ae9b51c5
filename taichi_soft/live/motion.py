"""Transfer positions and velocities of all bodies from one world to another with a different law."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray

from taichi_soft.live.choices import palette_of
from taichi_soft.live.controls import Controls


@dataclass
class Motion:
    """Motion of all bodies of a world.

    `rows` has for each slot: the name of the asset if a visitor added the body, else None; the positions [m];
    the velocities [m/s].
    """

    rows: dict[int, tuple[str | None, NDArray[Any], NDArray[Any]]] = field(default_factory=dict)


def motion_of(controls: Controls) -> Motion:
    """Return the positions and velocities of all bodies of a world."""
    world = controls.world
    names = {id(asset): name for name, asset in palette_of(world).items()}
    rows = {
        body.index: (names.get(id(body.asset)), body.positions(), body.velocities()) for body in world.bodies
    }
    return Motion(rows)


def continue_from(controls: Controls, motion: Motion) -> None:
    """Give all bodies of a world the motion of another world. Bodies are added or removed to match it."""
    world = controls.world
    palette, bodies = palette_of(world), {body.index: body for body in world.bodies}
    for slot, (name, positions, velocities) in motion.rows.items():
        body = bodies.pop(slot, None)
        if body is None and name in palette:
            body = world.spawn(palette[name], position=(0.0, 0.0, 50.0 + 2.0 * slot))
            controls.greet(body)
        if body is not None and body.vertex_count == len(positions):
            body.set_motion(positions, velocities)
    for body in bodies.values():
        world.despawn(body)
