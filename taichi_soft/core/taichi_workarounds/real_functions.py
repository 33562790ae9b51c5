"""Make branches and loops work in real functions.

A `ti.real_func` is compiled once and separately; a `ti.func` is copied into every caller. But if a real
function calls a `ti.func`, Taichi puts the branches and loops of the `ti.func` into the kernel. The
statements in these branches and loops then run unconditionally, or Taichi crashes.

This file is unnecessary once https://github.com/taichi-dev/taichi/issues/8514 is closed. The issue is open,
and the main branch has the fault.
"""

from taichi_soft.core.taichi_workarounds.importing import ti


def keep_branches_in_real_functions() -> None:
    """Make Taichi add the statements of a `ti.func` to the kernel or real function that it is compiling."""
    ti.lang.kernel_impl.Kernel.ast_builder = lambda _: (
        ti.lang.impl.get_runtime().compiling_callable.ast_builder()
    )
