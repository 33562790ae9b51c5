"""Motors: torque and force change momenta exactly, speeds are kept, and bodies are not torn."""

import numpy as np
import pytest

from taichi_soft import FrozenBodyWarning, Material, SoftBodyAsset, StateError, box, cylinder
from taichi_soft.world.bare import bare_world

DT = 1 / 60
WHEEL = cylinder(0.5, 0.4, rings=3, layers=3)
HUB = np.flatnonzero(np.linalg.norm(WHEEL.vertices[:, :2], axis=1) < 0.2)
BAR = box((0.6, 0.2, 0.2), cells=(6, 2, 2))
END = np.flatnonzero(BAR.vertices[:, 0] < -0.29)
RUBBER, JELLY = Material(1e6, 0.3, 1000.0), Material(1e5, 0.3, 1000.0)
EXPLICIT = ("leapfrog", pytest.param("lazy_leapfrog", marks=pytest.mark.soak))
IMPLICIT = pytest.param("implicit_euler", marks=pytest.mark.soak)


def made(mesh, material=RUBBER, *, pinned=(), position=(0.0, 0.0, 0.0), **options):
    world = bare_world(**{"floor": None, "gravity": (0.0, 0.0, 0.0), "collider_room": 1, **options})
    body = world.add_body(mesh, material, pinned=pinned, position=position)
    world.build()
    return world, body


def run(world, steps, substeps=None):
    for _ in range(steps):
        world.step(DT, substeps)


def arms_from(body, point, axis):
    """Return the lever arms of vertices about a line, (n,) [m]."""
    return np.linalg.norm(np.cross(body.positions().astype(float) - point, axis), axis=1)


@pytest.mark.parametrize("integrator", EXPLICIT)
def test_a_torque_changes_angular_momentum_by_torque_times_time_and_momentum_by_nothing(integrator):
    world, body = made(WHEEL, integrator=integrator)
    motor = world.add_motor(body, HUB, (0, 0, 2), speed=5.0, max_torque=50.0, is_fixed=True)
    run(world, 120)
    assert motor.effort == pytest.approx(50.0, rel=1e-5)
    assert body.angular_momentum()[2] == pytest.approx(100.0, rel=1e-5)
    assert np.abs(body.angular_momentum()[:2]).max() < 2.0  # what the axis takes up, as the mesh is not even
    np.testing.assert_allclose(body.momentum(), 0.0, atol=1e-3)


@pytest.mark.parametrize("integrator", [*EXPLICIT, IMPLICIT])
def test_a_force_changes_momentum_by_force_times_time(integrator):
    world, body = made(BAR, integrator=integrator)
    motor = world.add_motor(body, range(len(BAR.vertices)), (0, 3, 4), speed=90.0, max_force=30.0)
    run(world, 60)
    assert motor.effort == pytest.approx(30.0, rel=1e-5)
    np.testing.assert_allclose(body.momentum(), (0, 18.0, 24.0), rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("integrator", [*EXPLICIT, IMPLICIT])
def test_a_wheel_is_brought_to_a_speed_and_held_there(integrator):
    """Angular momentum is moment of inertia times speed, and no more effort is needed."""
    world, body = made(WHEEL, integrator=integrator)
    motor = world.add_motor(body, HUB, (0, 0, 1), speed=3.0, max_torque=200.0)
    substeps = 8 if integrator == "implicit_euler" else None
    run(world, 240, substeps)
    inertia = body.masses @ arms_from(body, body.center_of_mass(), (0, 0, 1)) ** 2
    rel = 0.05 if integrator == "implicit_euler" else 0.01  # whose steps damp a spin
    assert motor.measured_speed == pytest.approx(3.0, rel=rel)
    assert body.angular_momentum()[2] == pytest.approx(3.0 * inertia, rel=rel)
    efforts = []
    for _ in range(120):
        run(world, 1, substeps)
        efforts.append(motor.effort)
    assert abs(np.mean(efforts)) < 200.0 * rel


@pytest.mark.parametrize("integrator", EXPLICIT)
def test_what_hovers_is_held_up_by_its_weight(integrator):
    world, body = made(BAR, integrator=integrator, gravity=(0, 0, -9.81))
    motor = world.add_motor(body, range(len(BAR.vertices)), (0, 0, 1), speed=0.0, max_force=1e4)
    run(world, 60)
    assert motor.effort == pytest.approx(9.81 * body.masses.sum(), rel=1e-4)
    assert abs(body.center_of_mass()[2]) < 1e-4
    motor.set_limit(0.25 * 9.81 * body.masses.sum())
    before = body.momentum()[2]
    run(world, 30)
    assert body.momentum()[2] - before == pytest.approx(-0.75 * 9.81 * body.masses.sum() * 0.5, rel=1e-3)


def test_an_arm_on_a_shaft_is_held_by_the_torque_of_its_weight():
    world, body = made(BAR, pinned=END, gravity=(0, 0, -9.81))
    shaft = np.array([-0.3, 0.0, 0.0])
    rest = np.setdiff1d(np.arange(len(BAR.vertices)), END)
    motor = world.add_motor(body, rest, (0, 1, 0), speed=0.0, max_torque=1e4, is_fixed=True, point=shaft)
    for _ in range(2):  # in a first substep velocities are half a substep late
        world.step(1e-4, 8)
    torque = 9.81 * (body.masses[rest] @ (body.positions()[rest, 0] - shaft[0]))
    assert motor.effort == pytest.approx(-torque, rel=0.01)  # it sinks about +y


def test_an_axis_goes_with_the_particles_or_stays_in_space():
    quarter = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # z becomes x
    for is_fixed, axis in ((False, (1.0, 0.0, 0.0)), (True, (0.0, 0.0, 1.0))):
        world, body = made(WHEEL)
        world.add_motor(
            body, range(len(WHEEL.vertices)), (0, 0, 1), speed=9.0, max_torque=50.0, is_fixed=is_fixed
        )
        body.teleport(body.center_of_mass(), quarter)
        run(world, 30)
        np.testing.assert_allclose(body.angular_momentum(), 25.0 * np.array(axis), atol=0.05)


def test_a_driven_wheel_rolls():
    """Without slipping: as fast as its rim turns, from the axle to the floor."""
    stands = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    world = bare_world(friction=1.0, collider_room=1)
    body = world.add_body(WHEEL, RUBBER, position=(0, 0, 0.5), rotation=stands)
    world.build()
    motor = world.add_motor(body, HUB, (0, 1, 0), speed=4.0, max_torque=400.0)
    run(world, 180)
    start = body.center_of_mass()
    run(world, 120)
    rolled = np.linalg.norm((body.center_of_mass() - start)[:2]) / 2.0  # it steers a little, as its mesh does
    assert rolled == pytest.approx(4.0 * start[2], rel=0.02)
    assert motor.measured_speed == pytest.approx(4.0, rel=0.01)


def test_two_motors_of_one_body_do_not_disturb_each_other():
    """A screw: turned about the axis that it is pushed along."""
    world, body = made(WHEEL)
    turn = world.add_motor(body, HUB, (0, 0, 1), speed=2.0, max_torque=300.0)
    push = world.add_motor(body, HUB, (0, 0, 1), speed=1.0, max_force=2000.0)
    run(world, 240)
    assert turn.measured_speed == pytest.approx(2.0, rel=3e-3)
    assert push.measured_speed == pytest.approx(1.0, rel=3e-3)
    assert body.momentum()[2] == pytest.approx(body.masses.sum(), rel=0.01)


def test_what_is_removed_drives_no_longer_and_the_others_go_on():
    world, body = made(WHEEL)
    motors = [
        world.add_motor(body, HUB, (0, 0, 1), speed=9.0, max_torque=torque) for torque in (10.0, 20.0, 30.0)
    ]
    motors[1].remove()
    assert world.motors == [motors[0], motors[2]]
    run(world, 60)
    assert [motor.effort for motor in world.motors] == pytest.approx([10.0, 30.0])
    assert body.angular_momentum()[2] == pytest.approx(40.0, rel=1e-4)
    with pytest.raises(StateError, match="was removed: add another"):
        _ = motors[1].effort
    third = world.add_motor(body, HUB, (0, 0, 1), speed=0.0, max_torque=1.0)
    assert third.effort == 0.0


@pytest.mark.parametrize("integrator", ["leapfrog", IMPLICIT])
@pytest.mark.parametrize("limit", [{"max_torque": 1e12}, {"max_force": 1e12}], ids=str)
def test_no_torque_and_no_speed_breaks_a_body(integrator, limit):
    floor = None if integrator == "implicit_euler" else -0.7
    world, body = made(WHEEL, JELLY, integrator=integrator, gravity=(0, 0, -9.81), floor=floor)
    motor = world.add_motor(body, HUB, (1, 0, 0), speed=2e4, **limit)
    run(world, 60)
    assert not body.is_frozen
    assert np.isfinite([motor.effort, motor.measured_speed]).all()
    motor.remove()
    run(world, 300)
    assert not body.is_frozen
    assert body.flipped_count() == 0


def test_a_world_whose_driven_body_has_frozen_can_be_restored():
    """Its particles were beyond any number when the motor looked at them last."""
    world, body = made(WHEEL, JELLY, retries=0)
    motor = world.add_motor(body, HUB, (0, 0, 1), speed=5.0, max_torque=3.0)
    body.set_velocity((0.0, 0.0, 0.0), (0.0, 0.0, 1e3))
    with pytest.warns(FrozenBodyWarning):
        run(world, 4, 12)
    assert body.is_frozen
    world.restore(world.snapshot())
    assert motor.effort == 0.0


def test_effort_counts_the_attempt_that_was_kept_only():
    """A jelly on the floor, pulled so hard that steps are retried."""
    world, body = made(WHEEL, JELLY, gravity=(0, 0, -9.81), floor=-0.7)
    motor = world.add_motor(body, HUB, (1, 0, 0), speed=2e4, max_torque=2e4)
    for _ in range(60):
        world.step(DT)
        assert abs(motor.effort) <= 2e4 * (1 + 1e-4)


def test_a_body_stays_awake_while_a_motor_starts_slowly():
    world = bare_world(floor=None, gravity=(0, 0, 0), sleep_speed=0.05, collider_room=1)
    body = world.add_body(WHEEL, RUBBER)
    world.build()
    motor = world.add_motor(body, HUB, (0, 0, 1), speed=1.0, max_torque=1.0)
    run(world, 90)
    assert not body.is_asleep
    assert body.angular_momentum()[2] == pytest.approx(1.5, rel=1e-3)
    body.set_velocity((0, 0, 0))
    motor.set_limit(0.0)
    run(world, 90)
    assert body.is_asleep
    motor.set_limit(1.0)
    assert not body.is_asleep


def test_a_motor_leaves_with_its_body_and_comes_back_with_a_snapshot():
    world = bare_world(floor=None, gravity=(0, 0, 0), collider_room=1)
    asset = SoftBodyAsset(WHEEL, RUBBER)
    world.reserve(asset, 2)
    body = world.spawn(asset)
    world.build()
    motor = world.add_motor(body, HUB, (0, 0, 1), speed=9.0, max_torque=50.0)
    run(world, 30)
    data, name = world.snapshot(), world.state_hash()
    run(world, 30)
    told = world.state_hash(), motor.effort, motor.measured_speed
    world.despawn(body)
    assert not motor.is_mounted
    assert list(world.motors) == []
    other = world.spawn(asset)
    run(world, 10)
    assert np.abs(other.velocities()).max() < 1e-3
    world.restore(data)
    assert world.state_hash() == name
    assert world.motors == [motor]
    run(world, 30)
    assert (world.state_hash(), motor.effort, motor.measured_speed) == told


def test_a_flat_world_refuses_a_motor_and_names_the_way_out():
    world, body = made(WHEEL, collider_room=0, schedule="flat")
    with pytest.raises(StateError, match=r"'flat' .* motors.*'per_body'"):
        world.add_motor(body, HUB, (0, 0, 1), speed=1.0, max_torque=1.0)
    assert list(world.motors) == []
