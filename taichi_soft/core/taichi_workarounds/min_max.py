"""`ti.min` and `ti.max` with the same bits on every processor.

Taichi uses an instruction of the processor. Processors differ in which of -0 and 0, and which of a number and
NaN, is the smaller, and WebAssembly has no such instruction.

Needless once Taichi compiles `min` and `max` of floats to a comparison and a selection; main branch calls
LLVM's own. We know of no thread about it.
"""

import functools
from collections.abc import Callable
from typing import Any

from taichi_soft.core.taichi_workarounds.importing import ti


def choose_by_comparison() -> None:
    """Compare and select, which is one instruction as well. If the numbers are equal or one is NaN, the
    result is the second one, or the constant if one is constant."""
    ops = ti.lang.ops

    def choosing(plain: Callable[..., Any], comes_first: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(plain)  # otherwise Taichi warns of a foreign function
        def choose(a: Any, b: Any) -> Any:
            expressions = [each for each in (a, b) if ops.is_taichi_expr(each)]
            if not any(_is_real(each) for each in expressions):
                return plain(a, b)
            first, second = (a, b) if ops.is_taichi_expr(a) else (b, a)
            # Stored in variables, because Taichi evaluates an expression wherever it occurs.
            first, second = ti.lang.impl.expr_init(first), ti.lang.impl.expr_init(second)
            return ops.select(comes_first(first, second), first, second)

        return choose

    ops.min_impl = choosing(ops.min_impl, ops.cmp_lt)
    ops.max_impl = choosing(ops.max_impl, ops.cmp_gt)


def _is_real(expression: Any) -> bool:
    kind = expression.ptr.get_rvalue_type()
    return bool(ti._lib.core.is_real(kind.element_type() if expression.is_tensor() else kind))
