"""Whole worlds under the bounds check: no kernel reads or writes outside its fields."""

import numpy as np
import pytest
import random_play
import trimesh
from reading import burst, leave, not_finite

from engine_adapter import EngineAdapter, FixedStep
from taichi_soft import (
    BoxShape,
    CapsuleShape,
    Contact,
    Event,
    HeightFieldShape,
    Material,
    MeshShape,
    PlaneShape,
    Plasticity,
    SoftBodyAsset,
    SphereShape,
    SpringMaterial,
    Tearing,
    TetMesh,
    box,
    rope,
)
from taichi_soft.world.bare import bare_world

DT = 1 / 60
BLOCK = box((0.4, 0.4, 0.4), cells=(2, 2, 2))
JELLY = Material(3e4, 0.3, 500.0, 5.0)
FLAT = [np.diag(each) for each in ((0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, -1), (1e-6, 1e-6, 1e-6))]
"""To a point, a line, a sheet, inside out, and too small for float32 to tell vertices apart."""

pytestmark = [pytest.mark.soak, pytest.mark.filterwarnings("ignore::UserWarning")]


def wrecks(body):
    """Yield extreme (positions, velocities) that `set_motion` accepts."""
    rng = np.random.default_rng(body.index)
    x = body.positions()
    for change in FLAT:
        yield x.mean(axis=0) + (x - x.mean(axis=0)) @ change, 0 * x
    yield rng.uniform(-9.9e6, 9.9e6, x.shape), rng.uniform(-1e4, 1e4, x.shape)
    yield x + rng.normal(size=x.shape), rng.choice([-1.9e4, 0.0, 1.9e4], x.shape)
    yield np.full(x.shape, 9.99e6), np.full(x.shape, -1.9e4)


def wreck_all(world):
    """Deform each body in turn, then all bodies at once, each time from the same state."""
    adapter = EngineAdapter(world, FixedStep(DT, 8), budget_ms=1e6)
    adapter.advance(2 * DT)
    base = adapter.snapshot()
    for body in (*world.bodies, None):
        for motions in zip(*(wrecks(each) for each in world.bodies), strict=True):
            for each, motion in zip(world.bodies, motions, strict=True):
                if body in (each, None):
                    each.set_motion(*motion)
            for substeps in (1, 8):
                world.step(DT, substeps)
                assert not_finite(world, adapter) == []
            adapter.restore(base)
    for body in world.bodies:
        for destroy in (burst, leave):
            destroy(body)
    world.step(DT, 2)
    assert not_finite(world, adapter) == []


@pytest.mark.parametrize("schedule", ["per_body", "flat"])
def test_bodies_of_all_kinds_that_were_wrecked(schedule):
    world = bare_world(schedule=schedule)
    world.add_body(BLOCK, JELLY, position=(0, 0, 1), law="virial", flips="recover")
    world.add_body(BLOCK, JELLY, position=(1, 0, 1), law="neo_hookean")
    world.add_body(BLOCK, Material(3e4, 0.2, 500.0), position=(2, 0, 1), law="volume_springs")
    world.add_body(rope(1.0, 9, mass=0.1), SpringMaterial(500.0, 0.2), position=(3.5, 0, 1), law="springs")
    world.build()
    world.record_events([Event])
    wreck_all(world)


def test_lanes_beside_the_last_body():
    """The body has four particles and triangles, but kernels read eight at a time."""
    corners = 0.4 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    world = bare_world(soft_contact=True, floor=None, gravity=(0, 0, 0))
    for place, speed in ((0.0, 0.0), (0.2, -2.0)):
        world.add_body(TetMesh(corners, [[0, 1, 2, 3]]), JELLY, position=(place,) * 3, velocity=(speed,) * 3)
    world.build()
    for _ in range(10):
        world.step(DT, 4)
    assert (world.bodies[0].momentum() < -0.1 * world.bodies[0].masses.sum()).all()


def crowd(**options):
    """Make bodies that touch themselves, dent, tear and are grabbed. Colliders of all kinds overlap."""
    world = bare_world(soft_contact=True, floor=None, sleep_speed=0.05, **options)
    ring = MeshShape(trimesh.creation.torus(0.8, 0.25, 16, 10), cell=0.1, cache=False)
    waves = HeightFieldShape(np.sin(np.arange(42.0)).reshape(7, 6) / 5, 0.5)
    solids = PlaneShape(), SphereShape(0.3), BoxShape((3.0, 0.3, 0.2)), CapsuleShape(0.1, 1.0)
    for shape in (*solids, ring, waves):
        world.add_collider(shape, position=(0.0, 0.0, 0.1), restitution=0.3)
    cube = SoftBodyAsset(
        BLOCK,
        JELLY,
        contact=Contact(itself=True),
        plasticity=Plasticity(yield_strain=0.1, maximum=0.5),
        tearing=Tearing(stress=2e4),
        spare_vertices=20,
    )
    world.reserve(cube, 5)
    world.build()
    for place in ((0.0, 0.0, 1.0), (0.2, 0.1, 1.5)):
        world.spawn(cube, position=place, velocity=(0, 0, -5))
    held = world.bodies[0]
    held.attach([0, 1], world.add_frame(position=held.center_of_mass()), two_way=True)
    held.grab(3)
    world.add_motor(world.bodies[1], range(8), (0, 1, 0), speed=20.0, max_torque=50.0)
    world.record_events([Event])
    return world


@pytest.mark.parametrize("integrator", ["leapfrog", "implicit_euler"])
def test_a_crowd_that_was_wrecked(integrator):
    world = crowd(integrator=integrator)
    for _ in range(30):
        world.step(DT, 8)
    wreck_all(world)


@pytest.mark.guard
def test_a_random_game():
    """The game has soft contact, grid colliders, grabs, joints, frames, cuts, sleep and rewinds."""
    hashes, different = random_play.check(ticks=40)
    assert len(set(hashes)) == 40
    assert different == 0
