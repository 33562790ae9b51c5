"""Import Taichi with its environment, and patch Taichi 1.7."""

from __future__ import annotations

import functools
import os
import sys
import textwrap
import threading
import types
import warnings
import weakref
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

os.environ.setdefault("TI_SKIP_VERSION_CHECK", "ON")
os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")

with warnings.catch_warnings():
    warnings.simplefilter("ignore", SyntaxWarning)  # a docstring of Taichi, in Python 3.12 and later
    import taichi as ti

from taichi_soft.core.float_environment import with_usual_floats
from taichi_soft.core.threads import in_turn

__all__ = [
    "calling",
    "check_real_functions",
    "choose_by_comparison",
    "code_options",
    "has_pending_fields",
    "keep_kernels_apart",
    "let_any_number_of_threads_run",
    "let_threads_in",
    "let_whole_numbers_overflow",
    "not_kept",
    "remember_sources",
    "ti",
    "tree_of",
]

_MOST_THREADS = 1 << 20
"""Number of threads that kernels can use; more than any machine has."""

# A `ti.real_func` is compiled once, separately, while a `ti.func` is inlined at each call. But Taichi 1.7
# puts branches and loops of a `ti.func` called in a real function into the kernel, and crashes. With this
# patch they go into the function being compiled.
ti.lang.kernel_impl.Kernel.ast_builder = lambda _: ti.lang.impl.get_runtime().compiling_callable.ast_builder()


def _is_in_class(level_of_class_stackframe: int) -> bool:
    """True if a function is defined in a class. Taichi 1.7 reads the surrounding source of each function for
    that, which takes most of the import time."""
    try:
        return "__qualname__" in sys._getframe(level_of_class_stackframe).f_locals
    except ValueError:  # a script has no outer frame
        return False


ti.lang.kernel_impl._inside_class = _is_in_class


def _remember(look_up: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Cache the results of `look_up` per object, while the object exists."""
    known: weakref.WeakKeyDictionary[Any, Any] = weakref.WeakKeyDictionary()

    def remembered(key: Any) -> Any:
        if key not in known:
            known[key] = look_up(key)
        return known[key]

    return remembered


def remember_sources() -> None:
    """Cache sources of functions. Taichi 1.7 reads the source of a `ti.func` at each call, and formats the
    position of each name and operator for error messages. Here sources are read once, and messages show the
    plain line."""
    kernels = ti.lang.kernel_impl
    kernels.getsourcefile = _remember(kernels.getsourcefile)
    kernels.getsourcelines = _remember(kernels.getsourcelines)
    kernels.textwrap = types.SimpleNamespace(
        fill=functools.cache(textwrap.fill), dedent=functools.cache(textwrap.dedent)
    )
    ti.lang.ast.ast_transformer_utils.ASTTransformerContext.get_pos_info = _place_of


def _place_of(context: Any, node: Any) -> str:
    """Describe a source position: file, function, line, and a marker below it."""
    number, line = node.lineno + context.lineno_offset, context.src[node.lineno - 1].rstrip()
    start = context.indent + node.col_offset
    end = context.indent + node.end_col_offset if node.end_lineno == node.lineno else len(line)
    mark = " " * start + "^" * (end - start)
    return f'File "{context.file}", line {number}, in {context.func.func.__name__}:\n{line}\n{mark}\n'


def let_threads_in(lay_out_now: Callable[[Callable[[bool], None], bool], None]) -> None:
    """Make Taichi 1.7 usable from several threads. Its compiler state is global and not thread-safe. Here
    kernel calls and accesses to single field values are serialised, and the compiler state is per thread.

    Args:
        lay_out_now: calls Taichi's function that lays out fields, with its argument.
    """
    compiling, accessor = threading.local(), import_module("taichi.lang.field").SNodeHostAccessor
    ti.lang.impl.PyTaichi.inside_kernel = property(
        lambda _: getattr(compiling, "is_on", False), lambda _, is_on: setattr(compiling, "is_on", is_on)
    )
    ti.lang.kernel_impl.Kernel.__call__ = in_turn(with_usual_floats(ti.lang.kernel_impl.Kernel.__call__))
    make = accessor.__init__

    def make_in_turn(self: Any, snode: Any) -> None:
        make(self, snode)
        self.getter, self.setter = in_turn(self.getter), in_turn(self.setter)

    accessor.__init__ = make_in_turn
    lay_out = ti.lang.impl.PyTaichi.materialize_root_fb
    ti.lang.impl.PyTaichi.materialize_root_fb = staticmethod(functools.partial(lay_out_now, lay_out))


def let_any_number_of_threads_run() -> None:
    """Remove the number of threads from compiled code. Taichi 1.7 compiles the machine's number of threads
    into each parallel loop, so another machine would not find the kernel in the cache, or run it on too few
    threads. Here it is `_MOST_THREADS`, and Taichi uses the threads that it has started."""
    builder, given = ti._lib.core.ASTBuilder, threading.local()
    parallelize = builder.parallelize

    def give(self: Any, threads: int) -> None:  # 1 if the next loop is serial
        given.within = ti.lang.impl.get_runtime().compiling_callable
        parallelize(self, threads)

    def opening(begin: Callable[..., Any]) -> Callable[..., Any]:
        def begin_loop(self: Any, *arguments: Any) -> Any:
            # Evaluating a loop's range can compile a real function with its own loops.
            if getattr(given, "within", None) is ti.lang.impl.get_runtime().compiling_callable:
                given.within = None
            else:
                parallelize(self, _MOST_THREADS)
            return begin(self, *arguments)

        return begin_loop

    builder.parallelize = give
    for kind in ("range_for", "struct_for_on_snode", "struct_for_on_external_tensor"):
        name = f"begin_frontend_{kind}"
        setattr(builder, name, opening(getattr(builder, name)))


def keep_kernels_apart(version: str) -> None:
    """Give each version of the package separate cache keys in the running Taichi.

    A key contains the number of threads of a kernel, which is replaced by a number that no machine reaches,
    derived from the version.
    """
    ti.lang.impl.current_cfg().cpu_max_num_threads = (
        _MOST_THREADS + zlib.crc32(version.encode()) % _MOST_THREADS
    )


def code_options() -> str:
    """All current options of Taichi that affect code."""
    config = ti.lang.impl.current_cfg()
    names = [name for name in dir(config) if not name.startswith(("_", "offline_cache", "print_", "verbose"))]
    numbers = {name: getattr(config, name) for name in names if name != "num_compile_threads"}
    return str({name: value for name, value in numbers.items() if isinstance(value, (bool, int, float))})


def calling(function: int) -> Callable[[Any], None]:
    """Make a function for kernels that calls the C function at an address with one argument."""

    def call(argument: Any) -> None:
        runtime = ti.lang.impl.get_runtime()
        place = ti._lib.core.DebugInfo(runtime.get_current_src_info())
        given, nothing = ti.lang.expr.make_expr_group([argument]), ti.lang.expr.make_expr_group([])
        builder = runtime.compiling_callable.ast_builder()
        builder.insert_external_func_call(function, "", "", "", given, nothing, place)

    setattr(call, "_is_wrapped_kernel", True)  # noqa: B010  # avoids a warning of Taichi
    return call


@contextmanager
def not_kept() -> Iterator[None]:
    """Context in which compiled kernels are not stored in Taichi's cache."""
    config = ti.lang.impl.current_cfg()
    usual, config.offline_cache = config.offline_cache, False
    try:
        yield
    finally:
        config.offline_cache = usual


def choose_by_comparison() -> None:
    """Make `ti.min` and `ti.max` deterministic. Taichi 1.7 uses a CPU instruction whose result for -0 and 0,
    or for NaN, depends on the CPU, and which WebAssembly lacks. Here they compare and select, which is one
    instruction too. For equal numbers or NaN, they return the second argument, or the constant if one is
    constant."""
    ops = ti.lang.ops

    def choosing(plain: Callable[..., Any], comes_first: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(plain)  # avoids a warning of Taichi
        def choose(a: Any, b: Any) -> Any:
            expressions = [each for each in (a, b) if ops.is_taichi_expr(each)]
            if not any(_is_real(each) for each in expressions):
                return plain(a, b)
            first, second = (a, b) if ops.is_taichi_expr(a) else (b, a)
            # Assigned to a variable, because Taichi evaluates an expression at each use.
            first, second = ti.lang.impl.expr_init(first), ti.lang.impl.expr_init(second)
            return ops.select(comes_first(first, second), first, second)

        return choose

    ops.min_impl = choosing(ops.min_impl, ops.cmp_lt)
    ops.max_impl = choosing(ops.max_impl, ops.cmp_gt)


def _is_real(expression: Any) -> bool:
    kind = expression.ptr.get_rvalue_type()
    return bool(ti._lib.core.is_real(kind.element_type() if expression.is_tensor() else kind))


def tree_of(kernel: Any, arguments: Any, features: Any) -> tuple[Any, Any]:
    """Syntax tree of a kernel's source, and Taichi's context for transforming it."""
    slots = kernel.template_slot_locations
    tree, context = ti.lang.kernel_impl._get_tree_and_ctx(
        kernel, args=arguments, excluded_parameters=slots, arg_features=features
    )
    return tree, context


def has_pending_fields() -> bool:
    """True if Taichi has fields without a layout."""
    return not (ti.lang.impl._root_fb.finalized or ti.lang.impl._root_fb.empty)


def check_real_functions() -> None:
    """Check indices in real functions, which Taichi 1.7's bounds check omits. An assertion checks each
    index, and an invalid index becomes 0, so that the process can report it."""
    impl = ti.lang.impl
    plain = impl.subscript

    def checked(builder: Any, value: Any, *indices: Any, **options: Any) -> Any:
        is_real = isinstance(impl.get_runtime().compiling_callable, ti._lib.core.Function)
        if is_real and isinstance(value, ti.Field) and value.shape:
            (index,), (size,) = indices, value.shape  # fields of a world have one dimension
            is_inside = ti.lang.ops.logical_and(index >= 0, index < size)
            place = ti._lib.core.DebugInfo(impl.get_runtime().get_current_src_info())
            message = f"Accessing a field of size ({size}) in a real function with index (%d)"
            impl.ti_assert(is_inside, message, [impl.Expr(index).ptr], place)
            indices = (ti.select(is_inside, index, 0),)
        return plain(builder, value, *indices, **options)

    impl.subscript = checked


def let_whole_numbers_overflow() -> None:
    """Turn off overflow messages of Taichi 1.7's bounds checks, because hashes overflow on purpose."""
    program = ti._lib.core.Program
    plain = program.compile_kernel

    def compiled(self: Any, config: Any, *arguments: Any) -> Any:
        config.debug = False  # the bounds check has a separate switch
        try:
            return plain(self, config, *arguments)
        finally:
            config.debug = True  # the launch checks it, to raise assertions

    program.compile_kernel = compiled
