"""A function that is called by a real function keeps its branches and loops."""

from taichi_soft import init
from taichi_soft.core.runtime import ti


@ti.func
def halved(x):
    steps = 0
    if x > 100:
        steps = 1000
    while x > 1:
        x //= 2
        steps += 1
    return steps


@ti.real_func
def count_halvings(x: ti.i32) -> ti.i32:
    return halved(x)


@ti.kernel
def count(x: ti.i32) -> ti.i32:
    return count_halvings(x)


def test_a_branch_and_a_loop_run_only_where_their_condition_holds():
    init()
    assert [count(x) for x in (1, 2, 64, 128)] == [0, 1, 6, 1007]
