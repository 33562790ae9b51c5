"""Taichi reads a source once, recognises methods among kernels, and reports the line of an error."""

import inspect

import pytest

from taichi_soft import init
from taichi_soft.core.runtime import ti


@ti.func
def doubled(x):
    return 2 * x


@ti.kernel
def eightfold(x: ti.i32) -> ti.i32:
    return doubled(doubled(doubled(x)))


@ti.func
def unknown(x):
    y = doubled(x)
    return y + nowhere  # noqa: F821


@ti.kernel
def ask(x: ti.i32) -> ti.i32:
    return unknown(x)


def test_the_source_of_a_function_that_is_called_often_is_read_once(monkeypatch):
    init()
    read, inner = [], inspect.getsourcelines

    def noted(function):
        read.append(function.__name__)
        return inner(function)

    monkeypatch.setattr(inspect, "getsourcelines", noted)
    assert eightfold(3) == 24
    assert sorted(read) == ["doubled", "eightfold"]


def test_a_mistake_in_a_kernel_is_shown_in_its_line_each_time():
    init()
    line = inspect.getsourcelines(unknown)[1] + 3
    for _ in range(2):
        with pytest.raises(ti.TaichiCompilationError) as failure:
            ask(1)
        assert f'test_source_reading.py", line {line}, in unknown:' in str(failure.value)
        assert "    return y + nowhere  # noqa: F821\n               ^^^^^^^" in str(failure.value)


@ti.data_oriented
class Scale:
    def __init__(self, factor):
        self.factor = factor

    @ti.kernel
    def apply(self, x: ti.i32) -> ti.i32:
        return self.factor * x

    @ti.func
    def halved(self, x):
        return x // 2 * self.factor

    @ti.kernel
    def apply_to_half(self, x: ti.i32) -> ti.i32:
        return self.halved(x)


def test_kernels_and_functions_of_a_class_are_methods():
    init()
    assert [Scale(factor).apply(7) for factor in (2, 3)] == [14, 21]
    assert [Scale(factor).apply_to_half(8) for factor in (2, 3)] == [8, 12]
