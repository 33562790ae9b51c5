"""What a GPU would be sent, one launch per substep, run on the CPU: the same motion as ever."""

import numpy as np
import pytest

from taichi_soft import Device, FrozenBodyWarning, Material, box, sphere
from taichi_soft.core.types import Schedule
from taichi_soft.solver.schedules import choose_schedule, make_launch
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak

GPU = Device("cuda", 1, "pretended")


def as_on_gpu(world):
    """Let a built world of schedule "flat" launch its steps as it would on a GPU."""
    built = world._built
    built.launch = make_launch(Schedule.FLAT, built.state, built.program, built.scene, GPU)
    return world


@pytest.fixture
def make_world(jelly):
    """Two bodies of different models that land on the floor."""

    def make(schedule):
        world = bare_world(schedule=schedule)
        world.add_body(box(cells=(2, 2, 2)), jelly, position=(0, 0, 0.55), velocity=(1, 0, -2))
        world.add_body(sphere(0.5, 2), jelly, law="face", flips="recover", position=(2, 0, 0.6))
        world.build()
        return world

    return make


def test_a_gpu_takes_the_flat_schedule(make_world):
    scene = make_world("per_body")._context.layout
    assert choose_schedule(Schedule.AUTO, scene, GPU) is Schedule.FLAT


def test_one_launch_per_substep_makes_the_same_motion(make_world):
    """The tolerance covers sums in another order, and the different floors at the first contact."""
    usual, gpu = make_world("per_body"), as_on_gpu(make_world("flat"))
    for _ in range(30):
        usual.step(1 / 100, 6)
        gpu.step(1 / 100, 6)
    for one, other in zip(usual.bodies, gpu.bodies, strict=True):
        assert one.positions()[:, 2].min() < 0.01
        np.testing.assert_allclose(one.positions(), other.positions(), atol=1e-3)
        np.testing.assert_allclose(one.velocities(), other.velocities(), atol=5e-2)


@pytest.mark.filterwarnings("ignore::taichi_soft.UnstableStepWarning")
def test_a_body_that_breaks_is_frozen_and_the_other_goes_on():
    world = bare_world(schedule="flat", retries=0)
    for x, young in ((0, 1e12), (3, 1e4)):
        material = Material(young, 0.2, 1000.0, damping_ratio=0.0)
        world.add_body(box(cells=(1, 1, 1)), material, law="virial", position=(x, 0, 3))
    world.build()
    as_on_gpu(world)
    stiff, soft = world.bodies
    stiff.set_motion(stiff.positions() * np.array([1.0, 1.0, 0.9]), np.zeros((8, 3)))
    start = soft.positions()
    with pytest.warns(FrozenBodyWarning, match="body 0"):
        steps(world, 20)
    assert (stiff.is_frozen, soft.is_frozen) == (True, False)
    assert np.isfinite(stiff.positions()).all()
    seconds = 20 / 60
    # The leapfrog's fall is exact: g t^2 / 2.
    np.testing.assert_allclose((start - soft.positions())[:, 2], 0.5 * 9.81 * seconds**2, rtol=1e-4)


def steps(world, count):
    for _ in range(count):
        world.step(1 / 60, 2)
