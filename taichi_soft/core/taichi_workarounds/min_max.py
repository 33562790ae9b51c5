"""`ti.min` and `ti.max` with the same bits on every processor.

Taichi uses an instruction of the processor for `min` and `max`. For -0 and 0, and for a number and NaN, the
result of this instruction differs between processors. WebAssembly has no such instruction.

This file is unnecessary once Taichi compiles `min` and `max` of floats to a comparison and a selection. The
main branch uses LLVM's functions. We know of no issue about this.
"""

import functools
from collections.abc import Callable
from typing import Any

from taichi_soft.core.taichi_workarounds.importing import ti


def choose_by_comparison() -> None:
    """Make Taichi compile `min` and `max` of floats to a comparison and a selection.

    The compiler can still turn these two into one instruction. If both numbers are equal or one number is
    NaN, the result is the second number. If one number is a constant, the constant counts as the second.
    """
    ops = ti.lang.ops

    def choosing(plain: Callable[..., Any], comes_first: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(plain)  # otherwise Taichi warns about a foreign function
        def choose(a: Any, b: Any) -> Any:
            expressions = [each for each in (a, b) if ops.is_taichi_expr(each)]
            if not any(_is_real(each) for each in expressions):
                return plain(a, b)
            first, second = (a, b) if ops.is_taichi_expr(a) else (b, a)
            # Store the numbers in variables, because Taichi evaluates an expression at each use.
            first, second = ti.lang.impl.expr_init(first), ti.lang.impl.expr_init(second)
            return ops.select(comes_first(first, second), first, second)

        return choose

    ops.min_impl = choosing(ops.min_impl, ops.cmp_lt)
    ops.max_impl = choosing(ops.max_impl, ops.cmp_gt)


def _is_real(expression: Any) -> bool:
    kind = expression.ptr.get_rvalue_type()
    return bool(ti._lib.core.is_real(kind.element_type() if expression.is_tensor() else kind))
