"""A world for measurements."""

from __future__ import annotations

from typing import Any

from taichi_soft.world.world import World


def bare_world(**options: Any) -> World:
    """Make a world without contact between bodies, sleep and room for more colliders, unless asked for.

    For experiments, measurements and tests of one feature. Sleep would damp slow bodies, and contact between
    bodies takes longer to compile.
    Args:
        options: arguments of `World`.
    """
    return World(**{"soft_contact": False, "sleep_speed": 0.0, "collider_room": 0, **options})
