"""Taichi's workers, made to compute as IEEE 754 says."""

import numpy as np

from taichi_soft.core.float_environment import usual_environment_call
from taichi_soft.core.taichi_patches import calling, not_kept, ti


def give_workers_usual_floats(count: int) -> None:
    """Undo in all `count` workers what Taichi told them as it started: to take subnormal numbers for zero.

    Each of as many pieces of a loop as there are workers calls a function of C's, and waits for the others,
    so that no worker takes two.
    """
    function, environment = usual_environment_call()
    if not function:
        return

    set_environment = calling(function)

    @ti.kernel
    def set_everywhere(address: ti.i64, arrived: ti.types.ndarray(dtype=ti.i32, ndim=1)):
        ti.loop_config(block_dim=1)
        for _ in range(count):
            set_environment(address)
            ti.atomic_add(arrived[0], 1)
            while ti.atomic_max(arrived[0], -1) < count:
                pass

    with not_kept():  # with the function's address
        set_everywhere(environment, np.zeros(1, np.int32))
