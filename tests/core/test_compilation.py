"""Messages about kernels that compile: one message for each slow compilation, and none afterwards."""

import pytest

from taichi_soft.core import compilation
from taichi_soft.core.runtime import init, ti


@pytest.fixture
def told(monkeypatch):
    burst = compilation.Burst()
    monkeypatch.setattr(burst, "show", lambda text: told.append(text))
    monkeypatch.setattr(compilation.time, "perf_counter", lambda: clock[0])
    clock, told = [100.0], []

    def compile_in(seconds, name="step"):
        start = burst.begin(name)
        clock[0] += seconds
        burst.end(name, start, False)

    return compile_in, told, clock


def test_a_second_of_compiling_goes_by_before_anything_is_said(told):
    compile_in, said, _ = told
    compile_in(0.9)
    assert said == []
    compile_in(0.5)
    compile_in(0.5, "find_gaps")
    assert said == ["compiling find_gaps (2 kernels in 1 s; later starts load them from the cache)", ""]


def test_after_a_pause_counting_begins_anew(told):
    compile_in, said, clock = told
    compile_in(3.0)
    clock[0] += 6.0
    compile_in(0.1)
    assert said == []


def test_a_kernel_is_noted_when_it_first_runs_and_not_again(caplog):
    init("cpu")
    values = ti.ndarray(ti.i32, 4)

    @ti.kernel
    def fill_with(out: ti.types.ndarray(dtype=ti.i32, ndim=1), value: ti.i32):
        for i in range(out.shape[0]):
            out[i] = value

    with caplog.at_level("DEBUG", logger="taichi_soft"):
        for value in (1, 2, 3):
            fill_with(values, value)
    noted = [record for record in caplog.records if "fill_with" in record.getMessage()]
    assert len(noted) == 1
    assert values.to_numpy().tolist() == [3, 3, 3, 3]
