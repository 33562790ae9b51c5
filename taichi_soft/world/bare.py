"""Make a world for measurements."""

from __future__ import annotations

from typing import Any

from taichi_soft.world.world import World


def bare_world(**options: Any) -> World:
    """Make a world without contact between bodies, without sleep, and without capacity for more colliders.

    Use it for experiments, measurements and tests of one feature, because sleep would damp slow bodies, and
    contact between bodies takes longer to compile.
    Args:
        options: arguments of `World`, which can turn these features on.
    """
    return World(**{"soft_contact": False, "sleep_speed": 0.0, "collider_room": 0, **options})
