"""Restore IEEE 754 floats in Taichi's workers."""

import numpy as np

from taichi_soft.core.float_environment import usual_environment_call
from taichi_soft.core.taichi_patches import calling, not_kept, ti


def give_workers_usual_floats(count: int) -> None:
    """Turn off flush-to-zero, which Taichi turns on at its start, in all `count` workers.

    A loop with one part per worker calls a C function in each part. Each part waits for all others, so that
    every worker runs exactly one.
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

    with not_kept():  # the kernel contains the function's address
        set_everywhere(environment, np.zeros(1, np.int32))
