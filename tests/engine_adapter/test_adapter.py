"""The adapter, compared with direct stepping of an equal world and interpolation in NumPy."""

import time
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import engine_adapter
import taichi_soft
from engine_adapter import EngineAdapter, FixedStep
from taichi_soft import (
    FrozenBodyWarning,
    Material,
    OptionError,
    StateError,
    UnstableStepWarning,
    box,
)
from taichi_soft.world.bare import bare_world

DT = 1 / 60


@pytest.fixture
def adapter(make_world):
    return EngineAdapter(make_world(), FixedStep(dt=DT, substeps=4))


@pytest.fixture
def body(adapter):
    return adapter.world.bodies[0]


def snapshot(adapter):
    """Return everything that a refused call must not change."""
    body = adapter.world.bodies[0]
    return (
        body.positions().tobytes(),
        body.velocities().tobytes(),
        adapter.world.step_count,
        adapter.world.time,
        adapter.alpha,
        adapter.time,
        adapter.dropped_time,
        adapter.total_dropped_time,
    )


@pytest.mark.parametrize("package", [engine_adapter, taichi_soft])
def test_the_old_name_of_the_budget_status_works_with_a_warning(package):
    with pytest.warns(DeprecationWarning, match="BudgetStatus") as caught:
        assert package.GivenUp is engine_adapter.BudgetStatus
    assert caught[0].filename == __file__


def test_public_names():
    names = ["BudgetStatus", "EngineAdapter", "FixedStep", "Rollback", "RollbackSession", "SessionError"]
    assert sorted(engine_adapter.__all__) == names


def test_step_is_one_step_of_the_world(adapter, body, make_world):
    twin = make_world()
    for _ in range(20):
        adapter.step()
        twin.step(DT, 4)
    assert adapter.world.step_count == 20
    assert adapter.alpha == 0.0
    assert body.positions().tobytes() == twin.bodies[0].positions().tobytes()


def test_advance_makes_the_steps_that_are_due(adapter, body, make_world):
    twin = make_world()
    frames = [0.0, 0.01, 0.012, 0.05, 0.001, 0.03]
    assert [adapter.advance(frame) for frame in frames] == [0, 0, 1, 3, 0, 2]
    for _ in range(6):
        twin.step(DT, 4)
    assert body.positions().tobytes() == twin.bodies[0].positions().tobytes()


@pytest.mark.parametrize(("rate", "frames"), [(144, 144), (60, 60), (30, 30), (24, 24), (1000, 1000)])
def test_the_frame_rate_does_not_change_the_motion(make_world, rate, frames):
    """One second of frames is sixty steps, at any rate."""
    twin = make_world()
    for _ in range(60):
        twin.step(DT, 4)
    adapter = EngineAdapter(make_world(), FixedStep(dt=DT, substeps=4))
    made = sum(adapter.advance(1 / rate) for _ in range(frames))
    assert made == adapter.world.step_count == 60
    assert adapter.world.bodies[0].positions().tobytes() == twin.bodies[0].positions().tobytes()
    assert adapter.total_dropped_time == 0.0


def test_ten_thousand_equal_frames_make_one_step_each(adapter, monkeypatch):
    calls = []

    def step(dt, substeps):
        calls.append((dt, substeps))
        adapter.world._context.clock.steps += 1

    monkeypatch.setattr(adapter.world, "step", step)
    assert {adapter.advance(DT) for _ in range(10_000)} == {1}
    assert calls == [(DT, 4)] * 10_000


def test_substeps_are_left_to_the_world_by_default(make_world):
    adapter, twin = EngineAdapter(make_world(), FixedStep(dt=1 / 30)), make_world()
    for _ in range(5):
        adapter.step()
        twin.step(1 / 30)
    assert adapter.world.bodies[0].positions().tobytes() == twin.bodies[0].positions().tobytes()


def test_default_is_sixty_steps_a_second(make_world):
    adapter = EngineAdapter(make_world())
    assert adapter.fixed_step == FixedStep()
    assert adapter.advance(0.1) == 6


@settings(max_examples=40)
@given(alpha=st.floats(0, 0.999, allow_subnormal=False))
def test_positions_lie_between_the_last_two_steps(alpha, shared_run):
    adapter, before, now = shared_run(alpha)
    expected = (1 - adapter.alpha) * before.astype(float) + adapter.alpha * now.astype(float)
    drawn = adapter.positions(adapter.world.bodies[0])
    assert drawn.dtype == np.float32
    np.testing.assert_allclose(drawn, expected, atol=1e-6)
    assert adapter.alpha == pytest.approx(alpha, abs=1e-7)


@pytest.fixture(scope="module")
def shared_run():
    """Return a world that fell for a while, to be read at any alpha."""
    world = bare_world()
    body = world.add_body(box(cells=(2, 2, 2)), Material(1e5, 0.2, 1000.0, 20.0), position=(0, 0, 1.0))
    world.build()
    for _ in range(30):
        world.step(DT, 4)

    def at(alpha):
        adapter = EngineAdapter(world, FixedStep(dt=DT, substeps=4))
        before = body.positions()
        adapter.advance((1 + alpha) * DT)
        return adapter, before, body.positions()

    return at


def test_positions_at_alpha_zero_are_the_previous_step_bit_for_bit(adapter, body):
    adapter.advance(3 * DT)
    before = body.positions()
    adapter.step()
    assert adapter.positions(body).tobytes() == before.tobytes()


def test_time_belongs_to_the_positions(adapter, body):
    """In free fall the height tells the time: z = z0 - v-mean * t is linear within one step."""
    assert adapter.time == 0.0
    adapter.advance(0.5 * DT)
    assert adapter.time == 0.0
    put_in = 0.5 * DT
    for frame in (0.7 * DT, 0.3 * DT, 2.2 * DT, 0.0, 1.1 * DT):
        adapter.advance(frame)
        put_in += frame
        assert adapter.time == pytest.approx(put_in - DT, abs=1e-12)
    start = body.mesh.vertices[:, 2].mean() + 1.0
    # Leapfrog's parabola has no error at the steps; a chord of it lies at most g DT^2 / 8 below.
    height = adapter.positions(body).astype(float)[:, 2].mean()
    assert height == pytest.approx(start - 0.5 * 9.81 * adapter.time**2, abs=9.81 * DT**2 / 8 + 1e-6)


def test_a_new_world_is_drawn_at_its_start(adapter, body):
    adapter.advance(0.4 * DT)
    np.testing.assert_allclose(adapter.positions(body), body.mesh.vertices + np.array([0, 0, 1.0]), atol=1e-6)


def test_a_body_that_was_put_elsewhere_is_not_drawn_on_the_way(adapter, body):
    adapter.advance(2.5 * DT)
    there = body.mesh.vertices + np.array([5.0, 0.0, 3.0])
    body.set_motion(there, np.zeros_like(there))
    np.testing.assert_allclose(adapter.positions(body), there, atol=1e-6)


def test_too_long_a_frame_is_clamped_and_the_rest_dropped(make_world):
    adapter = EngineAdapter(make_world(), FixedStep(dt=0.25 / 16, substeps=4, max_steps=4))
    dt = adapter.fixed_step.dt
    assert adapter.advance(10 * dt) == 4
    assert adapter.dropped_time == 6 * dt
    assert adapter.alpha == 0.0
    assert adapter.advance(1.5 * dt) == 1
    assert adapter.dropped_time == 0.0
    assert adapter.advance(4 * dt) == 4
    assert (adapter.dropped_time, adapter.alpha) == (0.0, 0.5)
    assert adapter.advance(4.5 * dt) == 4
    assert adapter.dropped_time == dt
    assert adapter.total_dropped_time == 7 * dt


def test_no_spiral_of_death(make_world):
    """If a step takes longer than the time that it simulates, frames do not become longer and longer."""
    adapter = EngineAdapter(make_world(), FixedStep(dt=DT, substeps=4, max_steps=3))
    frame = DT
    lengths = []
    for _ in range(30):
        frame = max(DT, adapter.advance(frame) * 1.5 * DT)
        lengths.append(frame)
    assert max(lengths) <= 3 * 1.5 * DT
    assert adapter.total_dropped_time > 0.0
    spent = DT + sum(lengths[:-1])
    assert adapter.world.time + adapter.total_dropped_time + adapter.alpha * DT == pytest.approx(spent)


@pytest.mark.parametrize(
    "frame", [-1e-9, -1.0, float("nan"), float("inf"), -float("inf"), "0.1", None, True, [DT]]
)
def test_bad_frames_are_refused_and_change_nothing(adapter, frame):
    adapter.advance(20.5 * DT)
    adapter.advance(0.5 * DT)
    before = snapshot(adapter)
    with pytest.raises(OptionError, match="frame_dt"):
        adapter.advance(frame)
    assert snapshot(adapter) == before


def test_a_frame_of_no_time_is_allowed(adapter, body):
    adapter.advance(1.5 * DT)
    drawn = adapter.positions(body)
    assert adapter.advance(0) == adapter.advance(0.0) == 0
    assert adapter.positions(body).tobytes() == drawn.tobytes()


def test_a_step_that_raises_leaves_the_count_of_time_in_order(adapter, monkeypatch):
    adapter.advance(0.25 * DT)
    whole_step = adapter.world.step
    left = [2]

    def failing_step(*args):
        if left[0] == 0:
            raise RuntimeError("device lost")
        left[0] -= 1
        whole_step(*args)

    monkeypatch.setattr(adapter.world, "step", failing_step)
    with pytest.raises(RuntimeError, match="device lost"):
        adapter.advance(5.5 * DT)
    assert adapter.world.step_count == 2
    assert adapter.dropped_time == pytest.approx(3 * DT)
    assert adapter.alpha == pytest.approx(0.75)
    monkeypatch.undo()
    assert adapter.advance(0.25 * DT) == 1
    assert adapter.dropped_time == 0.0
    put_in = 6 * DT
    assert adapter.world.time + adapter.total_dropped_time + adapter.alpha * DT == pytest.approx(put_in)


def test_a_world_that_is_not_built_is_refused():
    world = bare_world(floor=None)
    world.add_body(box(cells=(1, 1, 1)), Material(1e5, 0.2, 1000.0))
    with pytest.raises(StateError, match="build"):
        EngineAdapter(world)


@pytest.mark.parametrize("world", [None, "world", 3])
def test_only_worlds_are_adapted(world):
    with pytest.raises(OptionError, match="world"):
        EngineAdapter(world)


def test_only_fixed_steps_are_taken(make_world):
    with pytest.raises(OptionError, match="FixedStep"):
        EngineAdapter(make_world(), 1 / 60)


def test_the_callers_buffer_is_filled_and_returned(adapter, body):
    adapter.advance(10.5 * DT)
    adapter.advance(0.75 * DT)
    out = np.full((body.vertex_count, 3), np.nan, dtype=np.float32)
    assert adapter.positions(body, out) is out
    assert adapter.positions(body, out=out) is out
    assert out.tobytes() == adapter.positions(body).tobytes()


def test_a_part_of_a_larger_buffer_can_be_filled(adapter, body):
    """A vertex buffer holds several bodies. Rows before and after the body's rows do not change."""
    whole = np.full((body.vertex_count + 10, 3), 7.0, dtype=np.float32)
    part = whole[4 : 4 + body.vertex_count]
    assert adapter.positions(body, out=part) is part
    np.testing.assert_array_equal(whole[4:-6], adapter.positions(body))
    assert (whole[:4] == 7.0).all()
    assert (whole[-6:] == 7.0).all()


def test_a_buffer_that_does_not_fit_is_refused_untouched(adapter, body, unfit_buffer):
    adapter.advance(1.5 * DT)
    before = snapshot(adapter)
    out = unfit_buffer(body.vertex_count)
    copy = np.array(out)
    with pytest.raises(OptionError, match="out must be"):
        adapter.positions(body, out=out)
    np.testing.assert_array_equal(np.array(out), copy)
    assert snapshot(adapter) == before


def test_bodies_of_other_worlds_are_refused(adapter, make_world):
    other = make_world().bodies[0]
    for stranger in (other, None, 0):
        with pytest.raises(OptionError, match="body"):
            adapter.positions(stranger)


def test_python_takes_a_small_part_of_a_frame(adapter, body):
    """The time is that of the adapter itself: a frame without a step, and the checks around the copy."""
    out = np.empty((body.vertex_count, 3), dtype=np.float32)
    adapter.advance(DT)
    adapter.positions(body, out)
    seconds = []
    for _ in range(300):
        start = time.perf_counter()
        adapter.advance(0.0)
        adapter.positions(body, out)
        seconds.append(time.perf_counter() - start)
    assert np.median(seconds) < 1e-3  # 0.04 ms on an idle machine; a frame of 60 Hz has 16.7 ms


def test_time_is_that_of_the_positions_also_after_other_steps(make_world):
    """The cube falls freely, so its height tells the time."""
    world = make_world()
    start = world.bodies[0].positions()[:, 2].astype(float).mean()
    world.step(0.1, 20)
    adapter = EngineAdapter(world, FixedStep(dt=DT, substeps=4))

    def told():
        return start - 0.5 * 9.81 * adapter.time**2

    assert adapter.positions(world.bodies[0])[:, 2].mean() == pytest.approx(told(), abs=1e-5)
    adapter.advance(DT)
    assert adapter.time == pytest.approx(0.1)
    assert adapter.positions(world.bodies[0])[:, 2].mean() == pytest.approx(told(), abs=1e-5)


def test_a_step_that_was_made_is_not_dropped_where_its_warning_is_an_error():
    world = bare_world(gravity=(0, 0, 0), floor=None, retries=0)
    mesh = box(cells=(2, 2, 2))
    steel = Material(1e9, 0.2, 1000.0)
    bodies = [world.add_body(mesh, steel, position=(x, 0, 0), law="virial") for x in (0, 3)]
    world.build()
    thrown = np.array(mesh.vertices)
    thrown[0] *= 50
    for body in bodies:
        body.set_motion(thrown, np.zeros_like(thrown))
    adapter = EngineAdapter(world, FixedStep(dt=DT, substeps=2))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnstableStepWarning)
        warnings.simplefilter("error", FrozenBodyWarning)
        with pytest.raises(FrozenBodyWarning, match=r"body 0 .*; body 1 "):
            adapter.advance(DT)
    assert world.step_count == 1
    assert adapter.dropped_time == 0.0
    assert all(body.failure for body in bodies)
