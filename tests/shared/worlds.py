"""Worlds of tests that study one thing."""

from taichi_soft import World


def bare_world(**options):
    """A world without contact between bodies, sleep and room for more colliders, unless `options` ask for it.

    For tests of one feature: the defaults would disturb what they measure, and take longer to compile.
    """
    return World(**{"soft_contact": False, "sleep_speed": 0.0, "collider_room": 0, **options})
