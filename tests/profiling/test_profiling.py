"""Profiles work and their yardstick computes the same motion. No time is asserted."""

import subprocess
import sys

import numpy as np
import pytest

from taichi_soft import box
from taichi_soft.core.errors import DeviceError
from taichi_soft.profiling import (
    compare_with_baseline,
    compile_baseline,
    devices,
    feature_costs,
    find_compiler,
    measure_budget,
    measure_crossover,
    measure_devices,
    measure_heaps,
    measure_moments,
    scaling,
)
from taichi_soft.profiling.profile_tables import tables
from taichi_soft.profiling.spread import Spread
from taichi_soft.profiling.stolen import processor_ticks, stolen_since

pytestmark = pytest.mark.soak

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler here")


def test_a_spread_holds_least_median_99th_percentile_and_most():
    spread = Spread.of([float(x) for x in range(101)])
    assert (spread.least, spread.median, spread.p99, spread.most) == (0.0, 50.0, 99.0, 100.0)
    assert spread.scaled(2.0).median == 100.0


@needs_compiler
def test_the_baseline_moves_a_body_as_the_kernels_do():
    rows = compare_with_baseline(compile_baseline(), 3, {1_000: (6, 6, 6)})
    assert [row.law for row in rows] == ["virial", "springs", "volume_springs"]
    row = max(rows, key=lambda row: row.deviation)
    assert row.tets > 900
    assert row.deviation < 1e-4
    assert row.ratio.least > 0


@needs_compiler
def test_the_baseline_leaves_subnormal_numbers_as_they_are():
    smallest = np.array([5e-324])
    compile_baseline()
    assert (smallest * 1.0)[0] > 0.0


@pytest.mark.parametrize("count", [1, 3])
def test_what_fits_a_frame_is_scaled_from_whole_frames(count):
    """More would have to run faster side by side than they were seen to."""
    for found in measure_budget(count, 5):
        assert found.bodies == int(count * 1e3 / found.rate / found.measured.frame.p99)
        assert found.bodies < 1e5


def test_the_crossover_times_both_schedules():
    rows = measure_crossover(3, cells=(3,))
    assert rows[0].ratio.median > 0
    ((title, table),) = tables({"crossover": rows})
    assert "flat against per_body" in title
    assert table.row_count == 1


def test_a_heap_is_timed_against_as_many_free_bodies(monkeypatch):
    monkeypatch.setattr(feature_costs, "_mesh", lambda: box((1.6, 1.6, 1.6), (1, 1, 1)))
    monkeypatch.setattr(feature_costs, "SETTLING", 3)
    heaps = measure_heaps(1, 3)
    assert [(heap.bodies, heap.tets) for heap in heaps] == [(32, 32 * 968), (32, 32 * 5)]
    for heap in heaps:
        assert heap.real_time * heap.step.median == pytest.approx(1e3 / 60)
        assert heap.ratio.least > 0
        assert heap.stolen is None or 0 <= heap.stolen < 1
    ((title, table),) = tables({"heap": heaps})
    assert "32 spheres in a pit" in title
    assert table.row_count == 2


def test_a_frame_with_a_spawn_is_timed_against_the_others(monkeypatch):
    monkeypatch.setattr(feature_costs, "_mesh", lambda: box((1.6, 1.6, 1.6), (1, 1, 1)))
    snapshot, come, go, plain = measure_moments(5)
    assert "5,000 tetrahedra" in snapshot.name
    assert plain.cost.median == pytest.approx(1.0)
    assert min(come.cost.least, go.cost.least, snapshot.cost.least) > 0


def test_a_missing_compiler_gives_one_line():
    code = "import sys; sys.argv=['x','profile','--baseline','--repeats','3','--bodies','1','--arch','cpu'];"
    code += "from taichi_soft.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        env={"PATH": "", "HOME": "/tmp"},
        timeout=200,
    )
    assert done.returncode == 1
    assert done.stderr.strip().splitlines()[-1].startswith("error: no C++ compiler")


def test_scaling_says_which_process_failed(monkeypatch):
    monkeypatch.setattr(scaling, "_PROGRAM", "raise SystemExit({threads})")
    with pytest.raises(DeviceError, match=r"1 threads.*--threads 1"):
        scaling.measure_scaling(2, (), 3)


def test_a_device_is_compared_with_the_processor_scene_by_scene(monkeypatch):
    one, many = measure_devices("cpu", 1, (), 3, ((1, 2), (2, 0)))
    assert (one.bodies, one.tets, many.bodies, many.tets) == (1, 40, 2, 2560)
    assert 0 < one.gain.least <= one.gain.median <= one.gain.most
    table = dict(tables({"devices": [one, many]}))
    assert [each.row_count for each in table.values()] == [2]
    monkeypatch.setattr(devices, "_PROGRAM", "raise SystemExit")
    with pytest.raises(DeviceError, match=r"'cpu'.*--arch cpu"):
        measure_devices("cuda", 1, (), 3)


def test_stolen_time_is_told_of_what_the_processors_were_wanted_for(monkeypatch, tmp_path):
    times = tmp_path / "stat"
    monkeypatch.setattr("taichi_soft.profiling.stolen.TIMES", times)
    assert stolen_since(processor_ticks()) is None
    times.write_text("cpu  100 0 20 5000 30 0 0 10 0 0\ncpu0 1 2 3 4 5 6 7 8 0 0\n")
    before = processor_ticks()
    times.write_text("cpu  150 5 25 9000 90 2 8 40 0 0\ncpu0 1 2 3 4 5 6 7 8 0 0\n")
    assert stolen_since(before) == pytest.approx(30 / (50 + 5 + 5 + 2 + 8 + 30))
