"""What comes to rest leaves no numbers so small that processors disagree about them, or compute slowly."""

import numpy as np
import pytest

from taichi_soft import Material, box
from taichi_soft.world.bare import bare_world
from taichi_soft.world.world import context_of_world

CUBE = box((1, 1, 1), (4, 4, 4))
JELLY = Material(1e5, 0.3, 1000.0, damping_ratio=0.2)

WORLDS = {
    "on a floor, with contact": {"soft_contact": True},
    "on a floor, by implicit Euler": {"integrator": "implicit_euler"},
    "afloat": {"floor": None, "gravity": (0, 0, 0), "soft_contact": True},  # by the first one's kernels
}
LAWS = ("neo_hookean", "virial", "springs")


def subnormals(world):
    """How many of the numbers that the next step depends on are smaller than normal ones of float32."""
    state = context_of_world(world).built.state
    count = 0
    for group in state.kept.values():
        for field, _, _ in group:
            numbers = np.asarray(field.to_numpy())
            if numbers.dtype.kind == "f":
                count += int(((numbers != 0) & (np.abs(numbers) < np.finfo(np.float32).tiny)).sum())
    return count


SOAKS = ("on a floor, by implicit Euler",)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.soak, pytest.mark.guard] if name in SOAKS else ())
        for name in WORLDS
    ],
)
def test_bodies_that_come_to_rest_make_no_subnormal_numbers(name):
    world = bare_world(**WORLDS[name])
    for number, law in enumerate(LAWS):
        world.add_body(CUBE, JELLY, position=(3 * number, 0, 0.6), law=law)
    world.build()
    if name == "afloat":
        for body in world.bodies:
            places = body.positions()
            middle = body.center_of_mass()
            body.set_motion(middle + (places - middle) * [1.02, 1, 1], np.zeros_like(places))
    found = 0
    for _ in range(20):
        for _ in range(60):
            world.step(1 / 60)
        found += subnormals(world)
    assert max(np.abs(body.velocities()).max() for body in world.bodies) < 1e-3
    assert found == 0
