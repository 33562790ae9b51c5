"""Bodies attached to frames of the engine: their positions, and the forces on the frames."""

import numpy as np
import pytest

from taichi_soft import FrozenBodyWarning, Material, OptionError, StateError, box
from taichi_soft.bodies.kernels.readout import read_velocities
from taichi_soft.control.frames import Frames
from taichi_soft.world.bare import bare_world
from taichi_soft.world.world import context_of_world

SIDE = np.flatnonzero(box(cells=(2, 2, 2)).vertices[:, 0] < -0.4)
WEIGHT = 9.81 * 1000.0
KINDS = ("leapfrog", "lazy_leapfrog", "implicit_euler")


def rows_of_frames(world):
    return len(context_of_world(world).of(Frames).rows)


def about_z(angle):
    return np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])


@pytest.fixture(scope="module")
def made():
    worlds = {}
    for kind in KINDS:
        world = bare_world(integrator=kind, floor=-1e3)  # far below; the floor lets all tests share kernels
        body = world.add_body(box(cells=(2, 2, 2)), Material(1e5, 0.2, 1000.0, 200.0))
        world.build()
        worlds[kind] = world, body
    return worlds


def kept_momentum(world, body):
    """Return the momentum of the velocities that the integrator stores.

    For leapfrog, they are half a substep old.
    """
    rows = np.empty((27, 3), dtype=np.float32)
    read_velocities(world._built.state, 0, 27, rows)
    return body.masses @ rows.astype(float)


def at_rest(world, body):
    for frame in world.frames:
        frame.remove()
    body.unpin()
    body.set_linear_damping(0.0)
    body.set_motion(body.mesh.vertices, np.zeros((27, 3)))
    return world, body


@pytest.fixture(params=["leapfrog", *(pytest.param(kind, marks=pytest.mark.soak) for kind in KINDS[1:])])
def loose(request, made):
    return at_rest(*made[request.param])


@pytest.fixture
def plain(made):
    return at_rest(*made["leapfrog"])


def test_a_hanging_body_pulls_with_its_weight_and_turns_with_its_lever_arm(loose):
    """A cantilever at rest: the moment of its weight about the frame, wherever that is."""
    world, body = loose
    frame = world.add_frame((0.2, 0.1, 1.5), (0, 0, 0.6, 0.8))
    attachment = body.attach(SIDE, frame, two_way=True)
    body.set_linear_damping(6.0)
    for _ in range(150):
        world.step(1 / 60, 8)
    np.testing.assert_allclose(attachment.force, [0, 0, -WEIGHT], atol=1e-3 * WEIGHT)
    arm = body.center_of_mass() - [0.2, 0.1, 1.5]
    np.testing.assert_allclose(attachment.torque, np.cross(arm, [0, 0, -WEIGHT]), atol=1e-3 * WEIGHT)


def test_two_attachments_share_the_load(plain):
    world, body = plain
    frame, other = world.add_frame(), world.add_frame((5, 0, 0))
    right = np.flatnonzero(body.mesh.vertices[:, 0] > 0.4)
    first, second = body.attach(SIDE, frame, two_way=True), body.attach(right, other, two_way=True)
    body.set_linear_damping(6.0)
    for _ in range(150):
        world.step(1 / 60, 8)
    np.testing.assert_allclose(first.force + second.force, [0, 0, -WEIGHT], atol=1e-3 * WEIGHT)
    assert first.force[2] == pytest.approx(second.force[2], rel=0.02)
    assert first.force[0] == pytest.approx(-second.force[0], abs=2)
    assert abs(first.force[0]) > 8  # it sags between the frames; about 11 N by its law


def test_what_the_frame_gives_is_what_the_body_gets(loose):
    """Impulses of gravity and of the frame add up to the momentum, however the frame is shaken."""
    world, body = loose
    frame = world.add_frame((0, 0, 1.0))
    attachment = body.attach(SIDE, frame, two_way=True)
    before, given = kept_momentum(world, body), np.zeros(3)
    for step in range(1, 31):
        t = step / 60
        frame.move_to((0.3 * np.sin(6 * t), 0, 1 + 0.2 * np.sin(3 * t)), about_z(t))
        body.apply_force((0, 60.0, 0), [0, 1, 26])
        world.step(1 / 60, 8)
        given -= attachment.force / 60
    lag = 1 / 960 if world.settings.integrator == "leapfrog" else 0.0
    expected = given + np.array([0, 30.0, -(0.5 - lag) * WEIGHT])
    # An implicit solve is as exact as its tolerance.
    close = 1.0 if world.settings.integrator == "implicit_euler" else 5e-3
    np.testing.assert_allclose(kept_momentum(world, body) - before, expected, atol=close)


def test_attached_particles_follow_a_turning_frame_exactly(loose):
    world, body = loose
    start = np.array([0.3, -0.2, 0.4])
    frame = world.add_frame(start, about_z(0.5))
    local = (body.positions()[SIDE] - start) @ about_z(0.5)
    attachment = body.attach(SIDE, frame)
    assert body.pinned.tolist() == SIDE.tolist()
    for step in range(1, 61):
        place = start + np.array([0, 0.01 * step, 0.02 * step])
        frame.move_to(place, about_z(0.5 + 0.1 * step))
        world.step(1 / 60, 8)
        np.testing.assert_allclose(frame.position, place, atol=1e-6)
        np.testing.assert_allclose(
            body.positions()[SIDE], local @ about_z(0.5 + 0.1 * step).T + place, atol=4e-6
        )
    for _ in range(2):
        world.step(1 / 60, 8)  # without another call, the frame stands still
    np.testing.assert_allclose(body.positions()[SIDE], local @ about_z(6.5).T + place, atol=4e-6)
    assert np.abs(body.velocities()[SIDE]).max() < 1e-3
    attachment.release()


def test_a_frame_keeps_its_axes_where_only_its_place_is_given(plain):
    world, _ = plain
    frame = world.add_frame((1, 2, 3), about_z(0.7))
    frame.move_to((0, 0, 1))
    np.testing.assert_allclose(frame.position, (1, 2, 3))  # until the step is made
    world.step(1 / 60, 8)
    np.testing.assert_allclose(frame.position, (0, 0, 1))
    np.testing.assert_allclose(frame.rotation, about_z(0.7), atol=1e-6)


def test_places_are_taken_relative_to_where_the_frame_is_not_where_it_will_be(plain):
    world, body = plain
    frame = world.add_frame()
    frame.move_to((0.05, 0, 0))
    before = body.positions()[SIDE]
    attachment = body.attach(SIDE, frame)
    world.step(1 / 60, 8)
    np.testing.assert_allclose(body.positions()[SIDE], before + np.array([0.05, 0, 0]), atol=1e-6)
    attachment.release()


def test_what_is_released_flies_on_and_can_be_attached_again(plain):
    world, body = plain
    frame = world.add_frame()
    attachment = body.attach(range(27), frame, two_way=True)
    for step in range(1, 4):
        frame.move_to((0.05 * step, 0, 0))
        world.step(1 / 60, 8)
    attachment.release()
    assert not attachment.is_attached
    assert len(body.pinned) == 0
    np.testing.assert_allclose(
        body.velocities() + np.array([0, 0, 9.81 / 960]), np.tile([3.0, 0, 0], (27, 1)), atol=0.02
    )
    world.step(1 / 60, 8)
    assert body.momentum()[0] == pytest.approx(3000, rel=1e-3)
    for use in (lambda: attachment.force, lambda: attachment.torque, attachment.release):
        with pytest.raises(StateError, match="was released"):
            use()
    assert body.attach(range(27), frame).is_attached


def test_other_pins_stay_when_all_are_let_go_but_attached_ones(plain):
    world, body = plain
    body.attach(SIDE, world.add_frame())
    body.pin([26])
    body.unpin()
    assert body.pinned.tolist() == SIDE.tolist()


def test_what_hangs_from_a_frame_jumps_with_it_rigidly(loose, turned):
    """Positions, velocities, pictures between two steps and targets: x -> R (x - a) + b."""
    world, body = loose
    start, end = np.array([0.3, -0.2, 0.4]), np.array([40.0, -3.0, 7.0])
    frame = world.add_frame(start, about_z(0.5))
    body.attach(SIDE, frame)
    body.pin([26])
    for step in range(5):
        frame.move_to(start + np.array([0, 0, 0.02 * step]), about_z(0.5 + 0.05 * step))
        world.step(1 / 60, 8)
    a, turn = frame.position.astype(float), turned @ frame.rotation.T
    x, v = body.positions(), body.velocities()
    halfway, goal = world.read_positions(body, 0.5).astype(float), x[26] + np.array([0.0, 0.02, 0.0])
    body.set_targets([26], [goal])
    frame.move_to((9, 9, 9))  # is forgotten
    frame.teleport(end, turned)
    np.testing.assert_allclose(frame.position, end, atol=1e-6)
    np.testing.assert_allclose(frame.rotation, turned, atol=1e-6)
    moved = (x - a) @ turn.T + end
    np.testing.assert_allclose(body.positions(), moved, atol=1e-5)
    np.testing.assert_allclose(world.read_positions(body, 0.5), (halfway - a) @ turn.T + end, atol=1e-5)
    np.testing.assert_allclose(body.velocities(), v @ turn.T, atol=0.01)
    world.step(1 / 60, 8)
    assert not body.is_frozen
    np.testing.assert_allclose(body.positions()[26], (goal - a) @ turn.T + end, atol=1e-5)
    np.testing.assert_allclose(body.positions()[SIDE], moved[SIDE], atol=1e-5)


def test_a_jump_leaves_no_trace_on_how_a_hanging_body_swings(plain):
    """About an upright axis and away: the body swings on as one whose frame stayed."""
    world, body = plain
    frame = world.add_frame()
    body.attach(SIDE, frame)
    for _ in range(10):
        world.step(1 / 60, 8)
    data, stories = world.snapshot(), []
    for place, turn in (((0, 0, 0), about_z(0)), ((3, -2, 5), about_z(2.0))):
        world.restore(data)
        frame.teleport(place, turn)
        for _ in range(10):
            world.step(1 / 60, 8)
        stories.append((body.positions() - np.array(place)) @ turn)
    np.testing.assert_allclose(stories[0], stories[1], atol=2e-5)
    world.restore(data)
    frame.teleport((0, 0, 9), keep_velocity=False)
    assert np.abs(kept_momentum(world, body)).max() == 0.0


@pytest.mark.soak
def test_what_is_dragged_too_far_in_a_step_without_retries_is_told_the_way_out():
    world = bare_world(floor=-1e3, retries=0)
    body = world.add_body(box(cells=(2, 2, 2)), Material(1e5, 0.2, 1000.0, 200.0), law="virial")
    world.build()
    frame = world.add_frame()
    body.attach(SIDE, frame)
    frame.move_to((0, 0, 30))
    with pytest.warns(FrozenBodyWarning, match=r"1 m .*30 m .*Frame\.teleport"):
        world.step(1 / 60, 8)
    world, body = at_rest(world, body)
    body.set_motion(np.full((27, 3), 9.9999e6), np.full((27, 3), 1.9e4))
    with pytest.warns(FrozenBodyWarning, match="substeps.*material"):
        world.step(1 / 60, 1)


def test_a_jump_that_cannot_be_is_refused_and_changes_nothing(plain):
    world, body = plain
    frame, other = world.add_frame((0, 0, 1)), world.add_frame()
    body.attach(SIDE, frame)
    name = world.state_hash()
    with pytest.raises(OptionError, match=r"beyond 1e\+07 m"):
        frame.teleport((9999999.9, 0, 0), about_z(np.pi))
    assert world.state_hash() == name
    hold = body.attach([26], other)
    with pytest.raises(StateError, match=r"body 0 is .*another frame: release"):
        frame.teleport((0, 0, 3))
    hold.release()
    frame.teleport((0, 0, 3))
    np.testing.assert_allclose(body.positions(), body.mesh.vertices + np.array([0, 0, 2]), atol=1e-6)


def test_a_removed_frame_lets_go_and_makes_room(plain):
    """Bodies of the removed frame fall, and bodies of other frames stay attached.

    A new frame reuses the row.
    """
    world, body = plain
    kept, frame = world.add_frame((0, 0, 1)), world.add_frame((0, 0, 2))
    held, left = body.attach([26], kept), body.attach(SIDE, frame)
    rows, data = rows_of_frames(world), world.snapshot()
    frame.remove()
    assert not frame.is_alive
    assert not left.is_attached
    assert held.is_attached
    assert body.pinned.tolist() == [26]
    for use in (lambda: frame.position, frame.remove, lambda: body.attach([1], frame)):
        with pytest.raises(StateError, match="was removed"):
            use()
    later = world.add_frame((5, 0, 0))
    later.move_to((5, 0, 1))
    assert not frame.is_alive
    assert rows_of_frames(world) == rows
    gone = world.snapshot()
    world.step(1 / 60, 8)
    name = world.state_hash()
    np.testing.assert_array_equal(body.positions()[26], body.mesh.vertices[26].astype(np.float32))
    assert body.center_of_mass()[2] < -5e-4
    world.restore(gone)
    assert not frame.is_alive
    np.testing.assert_array_equal(later.position, (5, 0, 0))
    world.step(1 / 60, 8)
    assert world.state_hash() == name
    world.restore(data)
    assert frame.is_alive
    assert left.is_attached
    assert not later.is_alive
    frame.move_to((0, 0, 2.05))
    world.step(1 / 60, 8)
    np.testing.assert_allclose(body.positions()[SIDE], body.mesh.vertices[SIDE] + [0, 0, 0.05], atol=1e-6)


def test_frames_that_come_and_go_take_no_room(plain):
    world, body = plain
    world.add_frame().remove()
    rows, size = rows_of_frames(world), len(world.snapshot())
    for turn in range(20):
        frame = world.add_frame((turn, 0, 0))
        body.attach([turn], frame)
        frame.remove()
    assert rows_of_frames(world) == rows
    assert len(world.snapshot()) < size + 50  # of digits


BAD_CALLS = {
    "frame of another world": (lambda w, b: b.attach([1], bare_world().add_frame()), OptionError),
    "frame that is a place": (lambda w, b: b.attach([1], (0, 0, 1)), OptionError),
    "no particles": (lambda w, b: b.attach([], w.add_frame()), OptionError),
    "particle out of range": (lambda w, b: b.attach([27], w.add_frame()), OptionError),
    "two_way 1": (lambda w, b: b.attach([26], w.add_frame(), two_way=1), OptionError),
    "attached twice": (lambda w, b: b.attach([26, SIDE[0]], w.add_frame()), StateError),
    "pin attached": (lambda w, b: b.pin([26, SIDE[1]]), StateError),
    "unpin attached": (lambda w, b: b.unpin(SIDE), StateError),
    "move attached": (lambda w, b: b.set_targets(SIDE[:1], [[0, 0, 0]]), StateError),
    "jump attached": (lambda w, b: b.teleport((0, 0, 9)), StateError),
    "feel one-way": (lambda w, b: b.attachments[0].force, StateError),
    "frame at NaN": (lambda w, b: w.add_frame((0, 0, float("nan"))), OptionError),
    "frame mirrored": (lambda w, b: w.add_frame((0, 0, 0), -np.eye(3)), OptionError),
    "move to NaN": (lambda w, b: b.attachments[0].frame.move_to((0, float("nan"), 0)), OptionError),
    "move sheared": (lambda w, b: b.attachments[0].frame.move_to((0, 0, 0), (1, 1, 0, 0)), OptionError),
}


@pytest.mark.parametrize("name", BAD_CALLS)
def test_a_refused_call_changes_nothing(plain, name):
    world, body = plain
    body.attach(SIDE, world.add_frame())
    call, error = BAD_CALLS[name]
    before = body.positions().tobytes(), body.velocities().tobytes(), body.pinned.tobytes()
    with pytest.raises(error):
        call(world, body)
    assert (body.positions().tobytes(), body.velocities().tobytes(), body.pinned.tobytes()) == before
    world.step(1 / 60, 8)
    np.testing.assert_array_equal(body.positions()[SIDE], body.mesh.vertices[SIDE].astype(np.float32))


def test_the_flat_schedule_attaches_one_way_only(cube, jelly):
    world = bare_world(schedule="flat", floor=-1e3)  # as above
    body = world.add_body(cube, jelly)
    world.build()
    frame = world.add_frame()
    with pytest.raises(StateError, match="schedule='per_body'"):
        body.attach(SIDE, frame, two_way=True)
    body.attach(SIDE, frame)
    for step in range(1, 6):
        frame.move_to((0, 0, 0.01 * step))
        world.step(1 / 60, 8)
    np.testing.assert_allclose(
        body.positions()[SIDE], cube.vertices[SIDE] + np.array([0, 0, 0.05]), atol=1e-6
    )
    assert body.center_of_mass()[2] < -0.005
