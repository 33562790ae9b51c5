"""Extend Taichi's index checks (`TAICHI_SOFT_DEBUG=1`) to real functions, and do not report overflows.

Taichi's bounds check skips the body of a `ti.real_func`. With `debug`, Taichi also prints a line for each
integer overflow. Hash functions overflow on purpose.

This file is unnecessary once Taichi runs `check_out_of_bound` on real functions, and once
https://github.com/taichi-dev/taichi/issues/8725 is closed (an option for the report of overflows). The main
branch has neither.
"""

from typing import Any

from taichi_soft.core.taichi_workarounds.importing import ti


def check_real_functions() -> None:
    """Make Taichi check each index in a real function before the index is used.

    An index out of range is replaced by 0, so that the process does not crash before it reports the index.
    """
    impl = ti.lang.impl
    plain = impl.subscript

    def checked(builder: Any, value: Any, *indices: Any, **options: Any) -> Any:
        is_real = isinstance(impl.get_runtime().compiling_callable, ti._lib.core.Function)
        if is_real and isinstance(value, ti.Field) and value.shape:
            (index,), (size,) = indices, value.shape  # the fields of a world have one dimension
            is_inside = ti.lang.ops.logical_and(index >= 0, index < size)
            place = ti._lib.core.DebugInfo(impl.get_runtime().get_current_src_info())
            message = f"Accessing a field of size ({size}) in a real function with index (%d)"
            impl.ti_assert(is_inside, message, [impl.Expr(index).ptr], place)
            indices = (ti.select(is_inside, index, 0),)
        return plain(builder, value, *indices, **options)

    impl.subscript = checked


def let_whole_numbers_overflow() -> None:
    """Compile without reporting integer overflows."""
    program = ti._lib.core.Program
    plain = program.compile_kernel

    def compiled(self: Any, config: Any, *arguments: Any) -> Any:
        config.debug = False  # turns off all checks except the bounds check
        try:
            return plain(self, config, *arguments)
        finally:
            config.debug = True  # otherwise, the launch would not raise errors of the bounds check

    program.compile_kernel = compiled
