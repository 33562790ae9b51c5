"""Bodies that are nearly at rest: what is fast in them fades, and what they do as a whole goes on."""

import numpy as np
import pytest

from taichi_soft import Material, box, sphere
from taichi_soft.world.bare import bare_world

DT, SLEEP = 1 / 60, 0.02
JELLY = Material(5e4, 0.4, 1000)


def turning(positions, velocities, masses):
    """Momentum and angular momentum, and velocities beside the rigid motion that has both."""
    center, velocity = masses @ positions / masses.sum(), masses @ velocities / masses.sum()
    arms, beside = positions - center, velocities - velocity
    spin = masses @ np.cross(arms, beside)
    inertia = np.einsum("p,pij->ij", masses, (arms**2).sum(axis=1)[:, None, None] * np.eye(3)) - np.einsum(
        "p,pi,pj->ij", masses, arms, arms
    )
    rest = beside - np.cross(np.linalg.solve(inertia, spin), arms)
    return masses.sum() * velocity, spin, np.sqrt(masses @ (rest**2).sum(axis=1) / masses.sum())


@pytest.mark.parametrize("mesh", [box((1.0, 0.6, 0.4), (5, 3, 2)), sphere(0.5, 4)], ids=["box", "sphere"])
def test_trembling_fades_within_a_second_with_all_momentum_kept_and_without_sleep_it_goes_on(mesh):
    left = []
    for sleep_speed in (SLEEP, 0.0):
        world = bare_world(gravity=(0, 0, 0), floor=None, sleep_speed=sleep_speed)
        body = world.add_body(mesh, JELLY)
        world.build()
        x = body.positions().astype(float)
        trembling = np.random.default_rng(1).normal(scale=0.03, size=x.shape)
        rigid = np.cross((0.1, 0.02, 0.05), x) + np.array([0.03, 0.02, -0.01])
        body.set_motion(x, rigid + trembling)
        masses = body.masses.astype(float)
        momentum, spin, before = turning(x, body.velocities().astype(float), masses)
        for _ in range(60):
            world.step(DT)
        momentum_now, spin_now, now = turning(*map(np.float64, (body.positions(), body.velocities())), masses)
        np.testing.assert_allclose(momentum_now, momentum, atol=1e-5 * np.linalg.norm(momentum))
        np.testing.assert_allclose(spin_now, spin, atol=2e-3 * np.linalg.norm(spin))
        left.append(now / before)
    assert left[0] < 0.05 < 0.2 < left[1]


def test_a_beam_that_sways_slowly_goes_on_as_if_nobody_slept():
    """Clamped at one end, its first mode (Euler and Bernoulli) is far below what is fast."""
    found = []
    for sleep_speed in (SLEEP, 0.0):
        world = bare_world(gravity=(0, 0, 0), floor=None, sleep_speed=sleep_speed)
        mesh = box((2.0, 0.2, 0.2), (20, 2, 2))
        body = world.add_body(mesh, Material(2e5, 0.3, 1000))
        along = mesh.vertices[:, 0] - mesh.vertices[:, 0].min()
        world.build()
        body.pin(np.flatnonzero(along < 1e-6))
        sway = 0.15 * (along / along.max()) ** 2  # [m/s], near the mode's own shape
        body.set_motion(mesh.vertices, sway[:, None] * (0, 0, 1))
        tip, heights = int(along.argmax()), []
        for _ in range(240):
            world.step(DT)
            heights.append(float(body.positions()[tip, 2]))
        found.append(np.array(heights) - mesh.vertices[tip, 2])
    calmed, free = found
    assert np.abs(free[120:]).max() > 0.005
    np.testing.assert_allclose(calmed, free, atol=0.04 * np.abs(free).max())


def test_a_body_that_bends_slowly_to_and_fro_falls_asleep_when_it_is_slow_as_a_whole():
    """The bar is free at both ends, and its velocities are similar to its first mode.

    Without sleep, its ends are still faster than the sleep speed after two seconds.
    """
    mesh = box((6.0, 0.2, 0.2), (60, 2, 2))
    along = mesh.vertices[:, 0] / mesh.vertices[:, 0].max()
    bending = 0.067 * (along**2 - 1 / 3)  # 0.02 m/s in the root mean square
    worlds = []
    for sleep_speed in (SLEEP, 0.0):
        world = bare_world(gravity=(0, 0, 0), floor=None, sleep_speed=sleep_speed)
        body = world.add_body(mesh, Material(2e4, 0.3, 1000))
        world.build()
        worlds.append(world)
        body.set_motion(mesh.vertices, bending[:, None] * (0, 0, 1))
        for _ in range(120):
            world.step(DT)
    sleeper, free = (world.bodies[0] for world in worlds)
    assert sleeper.is_asleep
    assert np.abs(free.velocities()).max() > SLEEP


def test_a_block_that_slides_slowly_without_friction_keeps_its_speed_and_stays_awake():
    world = bare_world(floor=0.0, friction=0.0, sleep_speed=SLEEP)
    block = world.add_body(
        box((0.4, 0.4, 0.4), (3, 3, 3)), JELLY, position=(0, 0, 0.2), velocity=(0.05, 0, 0)
    )
    world.build()
    start = None
    for step in range(360):
        world.step(DT)
        if step == 59:
            start = float(block.masses @ block.positions()[:, 0])
    way = (float(block.masses @ block.positions()[:, 0]) - start) / float(block.masses.sum())
    assert way == pytest.approx(0.05 * 300 * DT, rel=2e-3)
    assert not block.is_asleep
