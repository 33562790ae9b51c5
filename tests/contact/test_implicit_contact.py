"""Colliders and contact between bodies under implicit Euler: rest, friction, walls, momentum, the same bits.

All worlds are of one capacity, so that they share their kernels; bodies that belong to different experiments
have a group of their own. One substep a frame, but between bodies.
"""

import subprocess
import sys

import numpy as np
import pytest
from experiments import alone, turn

from taichi_soft import (
    BoxShape,
    Contact,
    Material,
    OptionError,
    PlaneShape,
    SphereShape,
    SpringMaterial,
    box,
    cloth,
    sphere,
)
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak

G = 9.81
DT = 1 / 60
FIRM = Material(young=1e6, poisson=0.2, density=1000.0, damping=300.0)
JELLY = Material(young=1e5, poisson=0.3, density=1000.0, damping=20.0)
BLOCK = box((1.0, 1.0, 0.5), (2, 2, 1))
CUBE = box((0.5, 0.5, 0.5), (3, 3, 3))


def room(**options):
    return bare_world(**{"floor": None, "collider_room": 1, "integrator": "implicit_euler", **options})


def add(world, number, mesh, material, **options):
    return world.add_body(mesh, material, contact=Contact(**alone(number)), **options)


def run(world, seconds, dt=DT):
    for _ in range(round(seconds / dt)):
        world.step(dt)


@pytest.mark.guard
def test_a_block_slides_on_an_incline_at_and_only_at_the_angle_of_friction():
    """Friction 2 % above the tangent holds it, to less than a tenth of a millimetre; 2 % below it does not.

    And what slides has the acceleration g (sin a - mu cos a).
    """
    slope, shares = 0.3, (0.5, 0.9, 0.98, 1.02, 1.1)
    tilt = turn(slope, (0.0, 1.0, 0.0))  # down along +x
    world = room()
    for number, share in enumerate(shares):
        options = {"friction": share * np.tan(slope), **alone(number)}
        world.add_collider(BoxShape((60.0, 4.0, 0.1)), rotation=tilt, position=-0.05 * tilt[:, 2], **options)
        add(world, number, BLOCK, FIRM, position=0.25 * tilt[:, 2], rotation=tilt)
    world.build()
    ways = []
    for seconds in (1.0, 1.5, 1.5):
        run(world, seconds)
        ways.append([body.center_of_mass() @ tilt[:, 0] for body in world.bodies])
    for share, way, bend in zip(
        shares, ways[-1] - np.array(ways[0]), np.diff(ways, 2, axis=0)[0], strict=True
    ):
        assert bend / 1.5**2 == pytest.approx(max(0.0, 1 - share) * G * np.sin(slope), abs=2e-3)
        assert (abs(way) < 1e-4) == (share > 1), share
    for body in world.bodies:
        assert (body.positions() @ tilt[:, 2]).min() > 0.0


@pytest.mark.parametrize("dt", [1 / 60, 1 / 30])
def test_a_belt_takes_a_block_along_by_mu_g_and_then_carries_it_at_its_speed(dt):
    """Stiff, flat and tall ones: none is faster, sways by more than a few per cent, or stays behind."""
    belt, tall = 3.0, box((0.5, 0.5, 1.0), (3, 3, 6))
    world = room()
    for number, (mesh, friction) in enumerate(((BLOCK, 0.5), (CUBE, 0.2), (tall, 0.2))):
        options = {"position": (0, 0, -0.25), "friction": friction, **alone(number)}
        world.add_collider(BoxShape((60, 4, 0.5)), **options).set_velocity((belt, 0, 0))
        add(world, number, mesh, FIRM, position=(-8, 0, -mesh.bounds[0, 2]))
    world.build()
    speeds, times = [], np.arange(1, round(3.0 / dt) + 1) * dt
    for _ in times:
        world.step(dt)
        speeds.append([body.momentum()[0] / body.masses.sum() for body in world.bodies])
    for speed, friction in zip(np.array(speeds).T, (0.5, 0.2, 0.2), strict=True):
        is_sliding = (times > 0.3) & (times < 0.9 * belt / (friction * G))
        expected = friction * G * times[is_sliding]
        np.testing.assert_allclose(speed[is_sliding], expected, atol=0.02)
        assert np.abs(speed[times > belt / (friction * G) + 0.1] - belt).max() < 0.08
        assert speed[-1] == pytest.approx(belt, abs=0.01)


def test_what_is_dropped_comes_to_rest_on_a_skin_and_never_sinks_into_it():
    """The body's weight reduces its height: by rho g H^2 / 2 E on a flat top without friction."""
    skin = 0.01
    world = room()
    tops = []
    for number, material in enumerate((FIRM, JELLY)):
        for shape, top in ((BoxShape((4.0, 4.0, 1.0)), 0.5), (SphereShape(2.0), 2.0)):
            number = len(tops)
            friction = 0.0 if top == 0.5 else 0.8
            options = {"position": (0, 0, -top), "thickness": skin, "friction": friction}
            world.add_collider(shape, **options, **alone(number))
            add(world, number, CUBE, material, position=(0, 0, 0.8))
            tops.append(top)
    world.build()

    def depths():
        for body, top in zip(world.bodies, tops, strict=True):
            x = body.positions() + np.array([0, 0, top])
            yield (x[:, 2] if top == 0.5 else np.linalg.norm(x, axis=1)).min() - top - skin

    for _ in range(360):
        world.step(DT)
        assert min(depths()) > -2e-6
    places = [body.center_of_mass() for body in world.bodies]
    run(world, 2.0)
    for body, place, top in zip(world.bodies, places, tops, strict=True):
        assert np.abs(body.velocities()).max() < 5e-3
        assert np.abs(body.center_of_mass() - place).max() < 1e-3
        if top == 0.5:
            pressed = 1000 * G * 0.5**2 / 2 / body.material.young
            assert np.ptp(body.positions()[:, 2]) == pytest.approx(0.5 - pressed, abs=0.2 * pressed)
            assert np.abs(body.velocities()[:, 2]).max() < 1e-3 * G * DT  # the solver's tolerance


def test_what_lies_feels_the_collider_with_its_weight_and_leaves_when_it_is_thrown():
    world = room(tolerance=1e-6)
    ground = world.add_collider(BoxShape((4.0, 4.0, 1.0)), position=(0, 0, -0.5))
    body = world.add_body(CUBE, FIRM, position=(0, 0, 0.25))
    world.build()
    run(world, 4.0)
    mass = body.masses.sum()
    assert ground.impulse[2] == pytest.approx(-mass * G * DT, rel=1e-4)
    body.apply_impulse((0, 0, 4.0 * mass))
    start = body.center_of_mass()[2]
    run(world, 0.25)
    assert body.center_of_mass()[2] - start == pytest.approx(4.0 * 0.25 - G * 0.25**2 / 2, abs=0.05)
    assert not ground.impulse.any()


@pytest.mark.parametrize("dt", [1 / 60, 1 / 10])
def test_what_colliders_take_up_is_what_the_body_lost(dt):
    """A spinning ball falls into a corner of a plane, two boxes and a sphere: to the solver's tolerance.

    The long steps are retried in pieces, and the results of the failed attempts are discarded.
    """
    world = room(tolerance=1e-6, most_iterations=1000)
    world.add_collider(PlaneShape(), friction=0.4)
    world.add_collider(BoxShape((0.5, 6, 6)), position=(1.8, 0, 3.0), rotation=turn(0.2, (0, 0, 1)))
    world.add_collider(BoxShape((6, 0.5, 6)), position=(0, 1.9, 3.0), friction=0.9)
    world.add_collider(SphereShape(0.6), position=(0.9, 1.3, 2.0))
    body = world.add_body(sphere(0.5, 2), Material(1e6, 0.3, 1000.0, 20.0), position=(-0.5, -0.5, 1.5))
    world.build()
    body.set_velocity((5.0, 6.0, -5.0), (3.0, -4.0, 5.0))
    before, taken, steps = body.momentum(), np.zeros((4, 3)), round(1.0 / dt)
    for _ in range(steps):
        world.step(dt)
        taken += [collider.impulse for collider in world.colliders]
    assert (np.linalg.norm(taken, axis=1) > 10.0).sum() >= 3
    weight = body.masses.sum() * np.array([0, 0, -G]) * steps * dt
    lost = before + weight - body.momentum()
    assert np.linalg.norm(lost) > 1000.0
    np.testing.assert_allclose(taken.sum(axis=0), lost, atol=5e-5 * np.linalg.norm(before))


def test_nothing_passes_a_wall_of_2_cm_at_30_metres_a_second():
    world = room(gravity=(0, 0, 0))
    world.add_collider(BoxShape((0.02, 20.0, 20.0)), position=(0.01, 0, 0))
    for pose, young, size in ((0.0, 1e6, 1.0), (0.4, 1e6, 0.3), (1.1, 1e7, 1.0), (2.3, 1e7, 0.1)):
        soft = Material(young, 0.3, 1000.0, 0.3 * (size / 2) ** 2 * np.sqrt(1000 * young))
        tilt = turn(pose, np.array([0.6, 0.48, 0.64]))
        options = {"position": (-size - 1, 0, 0), "rotation": tilt, "velocity": (30.0, 0, 0)}
        add(world, 0, box((size, size, size), (2, 2, 2)), soft, **options)
    world.build()
    for _ in range(45):
        world.step(DT)
        for body in world.bodies:
            assert body.positions()[np.unique(body.surface), 0].max() < 1e-4
    for body in world.bodies:
        assert not body.is_frozen
        assert body.momentum()[0] < 0.1 * 30.0 * body.masses.sum()


def test_a_turntable_carries_what_lies_on_it_on_a_circle():
    world = room()
    table = world.add_collider(BoxShape((8.0, 8.0, 0.5)), position=(0, 0, -0.25), friction=0.5)
    table.set_velocity((0, 0, 0), (0, 0, 1.2))
    body = world.add_body(BLOCK, FIRM, position=(1.0, 0.0, 0.25))
    world.build()
    body.set_velocity((0.0, 1.2, 0.0), (0.0, 0.0, 1.2))
    run(world, 2.5)
    x, y, _ = body.center_of_mass()
    assert np.hypot(x, y) == pytest.approx(1.0, abs=0.01)
    assert np.arctan2(y, x) == pytest.approx(3.0, abs=0.02)


@pytest.mark.parametrize("integrator", ["implicit_euler", "leapfrog"])
def test_a_sheet_and_a_cloth_on_a_turning_ball_turn_as_fast_as_its_surface(integrator):
    """Vertices at rest on the ball have its velocity, omega x r. The draped bodies are compressed."""
    speed, side = 3.0, 0.8
    world = room(integrator=integrator)
    sheet = box((side, side, 0.02), (8, 8, 1)), Material(1e5, 0.3, 500.0, damping_ratio=0.2)
    draped = cloth((side, side), (10, 10), 0.3), SpringMaterial(400.0, 0.5)
    for number, (mesh, material) in enumerate((sheet, draped)):
        ball = world.add_collider(SphereShape(1.0), friction=0.5, **alone(number))
        ball.set_velocity((0, 0, 0), (0, 0, speed))
        corner = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
        add(world, number, mesh, material, position=(0, 0, 1.02) - corner)
    world.build()
    run(world, 1.5)
    taken = np.zeros(2)
    for _ in range(60):
        world.step(DT)
        for number, body in enumerate(world.bodies):
            x, v = body.positions().astype(float), body.velocities().astype(float)
            spin = body.masses @ np.cross(x, v)[:, 2] / (body.masses @ (x[:, :2] ** 2).sum(axis=1))
            taken[number] += spin / 60
    assert taken == pytest.approx(speed, rel=0.01)


def test_a_lying_body_falls_when_what_it_lies_on_goes():
    world = room()
    table = world.add_collider(BoxShape((4.0, 4.0, 0.5)), position=(0, 0, -0.25))
    body = world.add_body(BLOCK, FIRM, position=(0, 0, 0.25))
    world.build()
    run(world, 1.0)
    table.teleport((0, 0, -5.0))
    run(world, 0.5)
    assert body.center_of_mass()[2] == pytest.approx(0.25 - G * 0.5**2 / 2, abs=0.05)


def test_a_restored_world_goes_on_bit_by_bit():
    world = room()
    table = world.add_collider(BoxShape((8.0, 8.0, 0.5)), position=(0, 0, -0.25))
    table.set_velocity((0.2, 0, 0), (0, 0, 0.3))
    for i in range(2):
        world.add_body(CUBE, JELLY, position=(1.5 * i, 0, 0.25 + 0.5 * i), rotation=turn(0.3 * i, (1, 0, 0)))
    world.build()
    run(world, 0.5)
    data = world.snapshot()

    def hashes():
        for _ in range(20):
            world.step(DT)
            yield world.state_hash(), table.impulse.tobytes()

    expected = list(hashes())
    world.restore(data)
    assert list(hashes()) == expected


def test_its_rehearsal_leaves_out_the_joints_it_does_not_have():
    world = room()
    for i in range(2):
        world.add_body(CUBE, JELLY, position=(i, 0, 1))
    world.build()
    before = world.state_hash()
    world.warm_up()
    assert world.state_hash() == before


@pytest.mark.guard
def test_bodies_that_collide_keep_their_momentum():
    world = bare_world(
        floor=None,
        gravity=(0, 0, 0),
        integrator="implicit_euler",
        soft_contact=True,
        tolerance=1e-6,
        most_iterations=1000,
    )
    a = world.add_body(CUBE, JELLY, velocity=(2, 0, 0))
    b = world.add_body(CUBE, JELLY, position=(0.8, 0.2, 0.1), velocity=(-1, 0, 0))
    world.build()
    before, own = a.momentum() + b.momentum(), a.momentum()
    assert world.stable_substeps(DT) == 4
    run(world, 1.0)
    passed = np.linalg.norm(a.momentum() - own)
    assert passed > 100.0
    np.testing.assert_allclose(a.momentum() + b.momentum(), before, atol=1e-5 * passed)


@pytest.mark.guard
def test_two_blocks_stand_on_each_other_and_fall_asleep():
    world = bare_world(integrator="implicit_euler", soft_contact=True, sleep_speed=0.02)
    for i in range(2):
        world.add_body(CUBE, FIRM, position=(0, 0, 0.26 + 0.52 * i))
    world.build()
    run(world, 4.0)
    for i, body in enumerate(world.bodies):
        assert body.is_asleep
        assert body.center_of_mass() == pytest.approx((0, 0, 0.25 + 0.5 * i), abs=0.01)


SCRIPT = """
import sys
import numpy as np
from taichi_soft import BoxShape, Material, World, box, init
init("cpu", threads=int(sys.argv[1]))
world = World(integrator="implicit_euler", sleep_speed=0)
world.add_collider(BoxShape((4.0, 4.0, 0.2)), rotation=(0.1, 0.0, 0.0, 0.995))
for i in range(4):
    place = (0.1 * i + 3.0 * (i % 2), 0.05 * i, 0.6 + 0.4 * i)
    world.add_body(box((0.5,) * 3, (3, 3, 3)), Material(1e5, 0.3, 1000.0, 20.0), position=place)
world.build()
for _ in range(60):
    world.step(1 / 60)
np.savez(sys.argv[2], *[rows for b in world.bodies for rows in (b.positions(), b.velocities())])
"""


def test_the_same_bits_for_one_and_two_threads(tmp_path):
    found = []
    for threads in (1, 2):
        out = tmp_path / f"{threads}.npz"
        subprocess.run([sys.executable, "-c", SCRIPT, str(threads), str(out)], check=True, timeout=300)
        found.append(dict(np.load(out)))
    for name, rows in found[0].items():
        assert np.isfinite(rows).all()
        assert rows.tobytes() == found[1][name].tobytes()


def test_explicit_euler_still_takes_no_colliders():
    world = bare_world(integrator="explicit_euler", collider_room=1)
    world.add_body(CUBE, JELLY, position=(0, 0, 1))
    with pytest.raises(OptionError, match=r"colliders, .*'explicit_euler'"):
        world.build()
