"""Every number that leaves the library is finite, or the call raises: also once a body froze."""

import numpy as np
import pytest
from reading import burst, leave, not_finite

from engine_adapter import EngineAdapter, FixedStep
from taichi_soft import Event, Material, PlaneShape, box
from taichi_soft.world.bare import bare_world

DT = 1 / 60
BLOCK = box((0.4, 0.4, 0.4), cells=(2, 2, 2))
LEFT = np.flatnonzero(BLOCK.vertices[:, 0] < -0.19)
JELLY = Material(3e4, 0.3, 500.0, 5.0)

pytestmark = [
    pytest.mark.soak,
    pytest.mark.filterwarnings(
        "ignore::taichi_soft.FrozenBodyWarning", "ignore::taichi_soft.UnstableStepWarning"
    ),
]


def held_world(**options):
    """Bodies on frames and in hands, and one that falls."""
    world = bare_world(**{"retries": 0, **options})
    for x in (0.0, 0.6, 3.0):
        world.add_body(BLOCK, JELLY, position=(x, 0.0, 1.0), law="virial")
    world.build()
    for body in world.bodies[:2]:
        body.attach(LEFT, world.add_frame(position=(0.0, 0.0, 1.0)), two_way=True)
        body.grab(3)
    world.record_events([Event])
    return world


@pytest.mark.parametrize("integrator", ["leapfrog", "implicit_euler"])
def test_all_that_is_read_stays_finite_whichever_body_freezes(integrator):
    """Frames and grabs of the frozen body no longer feel its forces, even after its failure was read."""
    world = held_world(integrator=integrator)
    adapter = EngineAdapter(world, FixedStep(DT, 8), budget_ms=1e3)
    for _ in range(3):
        adapter.advance(DT)
    assert not_finite(world, adapter) == []
    base = adapter.snapshot()
    for number in range(3):
        for destroy in (burst, leave):
            adapter.restore(base)
            body = world.bodies[number]
            destroy(body)
            for substeps in (1, 8, 8):
                world.step(DT, substeps)
                assert not_finite(world, adapter) == []
            if not body.is_frozen:  # implicit Euler can save one that nothing holds: it takes its speed away
                assert integrator == "implicit_euler"
                assert number == 2
                continue
            for each in body.attachments:
                assert not np.concatenate([each.force, each.torque]).any()
            assert all(not grab.force.any() for grab in world.grabs if grab.body is body)


def test_the_load_on_a_collider_is_finite_where_a_solve_overflows():
    """A block torn to pieces on it: its forces are beyond what float32 holds, though it goes on."""
    world = bare_world(integrator="implicit_euler", floor=None)
    body = world.add_body(BLOCK, JELLY, position=(0, 0, 1))
    ground = world.add_collider(PlaneShape(), restitution=0.3)
    world.build()
    rng = np.random.default_rng(0)
    for _ in range(20):
        x, v = rng.uniform(-9.9e6, 9.9e6, BLOCK.vertices.shape), rng.uniform(-1e4, 1e4, BLOCK.vertices.shape)
        body.set_motion(x, v)
        for substeps in (1, 8):
            world.step(DT, substeps)
            assert np.isfinite([ground.impulse, ground.angular_impulse]).all()
