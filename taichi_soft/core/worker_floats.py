"""Taichi's workers, made to compute as IEEE 754 says."""

from typing import Any

import numpy as np

from taichi_soft.core.float_environment import usual_environment_call
from taichi_soft.core.taichi_patches import ti


def give_workers_usual_floats(count: int) -> None:
    """Undo in all `count` workers what Taichi told them as it started: to take subnormal numbers for zero.

    Each of as many pieces of a loop as there are workers calls a function of C's, and waits for the others,
    so that no worker takes two.
    """
    function, environment = usual_environment_call()
    if not function:
        return

    def set_environment(address: Any) -> None:
        runtime = ti.lang.impl.get_runtime()
        place = ti._lib.core.DebugInfo(runtime.get_current_src_info())
        given, nothing = ti.lang.expr.make_expr_group([address]), ti.lang.expr.make_expr_group([])
        builder = runtime.compiling_callable.ast_builder()
        builder.insert_external_func_call(function, "", "", "", given, nothing, place)

    set_environment._is_wrapped_kernel = True  # type: ignore[attr-defined]  # or Taichi warns of it

    @ti.kernel
    def set_everywhere(address: ti.i64, arrived: ti.types.ndarray(dtype=ti.i32, ndim=1)):
        ti.loop_config(block_dim=1)
        for _ in range(count):
            set_environment(address)
            ti.atomic_add(arrived[0], 1)
            while ti.atomic_max(arrived[0], -1) < count:
                pass

    config = ti.lang.impl.current_cfg()
    config.offline_cache = False  # it would keep the function's address
    try:
        set_everywhere(environment, np.zeros(1, np.int32))
    finally:
        config.offline_cache = True
