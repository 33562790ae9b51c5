"""Taichi with its environment, and with what Taichi 1.7 does not do as we need it."""

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
    warnings.simplefilter("ignore", SyntaxWarning)  # Python 3.12 and later, of a docstring of Taichi's
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
"""Of which kernels may make use: no machine has as many."""

# A `ti.real_func` is compiled once and by itself, where a `ti.func` is copied to wherever it is called. But
# Taichi 1.7 puts branches and loops of a `ti.func` called in it into the kernel, and crashes. With this
# they go into what is being compiled.
ti.lang.kernel_impl.Kernel.ast_builder = lambda _: ti.lang.impl.get_runtime().compiling_callable.ast_builder()


def _is_in_class(level_of_class_stackframe: int) -> bool:
    """Whether a function is defined in a class. Taichi 1.7 reads the source around each for that: 0.4 s of
    0.7 s of our import."""
    try:
        return "__qualname__" in sys._getframe(level_of_class_stackframe).f_locals
    except ValueError:  # there is nothing around a script
        return False


ti.lang.kernel_impl._inside_class = _is_in_class


def _remember(look_up: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """`look_up`, which asks once about each object, for as long as the object lives."""
    known: weakref.WeakKeyDictionary[Any, Any] = weakref.WeakKeyDictionary()

    def remembered(key: Any) -> Any:
        if key not in known:
            known[key] = look_up(key)
        return known[key]

    return remembered


def remember_sources() -> None:
    """Wherever a `ti.func` is called, Taichi 1.7 reads its source again. For messages of errors it writes
    down where each name and operator in it stands, and wraps the lines. Here sources are read once, and
    messages have the first line as it is."""
    kernels = ti.lang.kernel_impl
    kernels.getsourcefile = _remember(kernels.getsourcefile)
    kernels.getsourcelines = _remember(kernels.getsourcelines)
    kernels.textwrap = types.SimpleNamespace(
        fill=functools.cache(textwrap.fill), dedent=functools.cache(textwrap.dedent)
    )
    ti.lang.ast.ast_transformer_utils.ASTTransformerContext.get_pos_info = _place_of


def _place_of(context: Any, node: Any) -> str:
    """Where something stands in a source: file, function, its first line, and a mark below that."""
    number, line = node.lineno + context.lineno_offset, context.src[node.lineno - 1].rstrip()
    start = context.indent + node.col_offset
    end = context.indent + node.end_col_offset if node.end_lineno == node.lineno else len(line)
    mark = " " * start + "^" * (end - start)
    return f'File "{context.file}", line {number}, in {context.func.func.__name__}:\n{line}\n{mark}\n'


def let_threads_in(lay_out_now: Callable[[Callable[[bool], None], bool], None]) -> None:
    """Taichi 1.7 takes what one thread compiles for what all do, and two that compile at once for one. Here
    each kernel and each number in a field is a turn of one thread, for which others wait, and what is being
    compiled is known to the thread that does it.

    Args:
        lay_out_now: calls Taichi's own function, which lays out fields, with its argument.
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
    """Taichi 1.7 compiles into each parallel loop how many threads may run it: as many as the machine has.
    Another machine would not find that kernel, or run it on too few. Here it is `_MOST_THREADS`, of which
    Taichi takes those that it has started."""
    builder, given = ti._lib.core.ASTBuilder, threading.local()
    parallelize = builder.parallelize

    def give(self: Any, threads: int) -> None:  # 1 where the next loop is to be serial
        given.within = ti.lang.impl.get_runtime().compiling_callable
        parallelize(self, threads)

    def opening(begin: Callable[..., Any]) -> Callable[..., Any]:
        def begin_loop(self: Any, *arguments: Any) -> Any:
            # To find how far a loop goes, a real function may be compiled, with loops of its own.
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
    """Have Taichi, which runs already, look for kernels under another key in each version of the package.

    A key has in it on how many threads a kernel may run. That is from now on a number that no machine
    reaches, made of the version.
    """
    ti.lang.impl.current_cfg().cpu_max_num_threads = (
        _MOST_THREADS + zlib.crc32(version.encode()) % _MOST_THREADS
    )


def code_options() -> str:
    """All options with which Taichi runs that code depends on."""
    config = ti.lang.impl.current_cfg()
    names = [name for name in dir(config) if not name.startswith(("_", "offline_cache", "print_", "verbose"))]
    numbers = {name: getattr(config, name) for name in names if name != "num_compile_threads"}
    return str({name: value for name, value in numbers.items() if isinstance(value, (bool, int, float))})


def calling(function: int) -> Callable[[Any], None]:
    """For kernels: what calls the C function at an address, with one argument."""

    def call(argument: Any) -> None:
        runtime = ti.lang.impl.get_runtime()
        place = ti._lib.core.DebugInfo(runtime.get_current_src_info())
        given, nothing = ti.lang.expr.make_expr_group([argument]), ti.lang.expr.make_expr_group([])
        builder = runtime.compiling_callable.ast_builder()
        builder.insert_external_func_call(function, "", "", "", given, nothing, place)

    setattr(call, "_is_wrapped_kernel", True)  # noqa: B010  # or Taichi warns of it
    return call


@contextmanager
def not_kept() -> Iterator[None]:
    """Kernels that are compiled within do not get into Taichi's cache."""
    config = ti.lang.impl.current_cfg()
    usual, config.offline_cache = config.offline_cache, False
    try:
        yield
    finally:
        config.offline_cache = usual


def choose_by_comparison() -> None:
    """Taichi 1.7 leaves the lesser of two numbers to the processor. Which of -0 and 0 that is, and of a
    number and NaN, differs from one kind to the next, and WebAssembly has no instruction for it. Here
    `ti.min` and `ti.max` compare and select, which is one instruction as well. Of equal numbers, or if one is
    NaN, they take the second, or the constant where one is constant."""
    ops = ti.lang.ops

    def choosing(plain: Callable[..., Any], comes_first: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(plain)  # or Taichi would warn of a function that is not its own
        def choose(a: Any, b: Any) -> Any:
            expressions = [each for each in (a, b) if ops.is_taichi_expr(each)]
            if not any(_is_real(each) for each in expressions):
                return plain(a, b)
            first, second = (a, b) if ops.is_taichi_expr(a) else (b, a)
            # Kept under a name, as Taichi computes an expression wherever it stands.
            first, second = ti.lang.impl.expr_init(first), ti.lang.impl.expr_init(second)
            return ops.select(comes_first(first, second), first, second)

        return choose

    ops.min_impl = choosing(ops.min_impl, ops.cmp_lt)
    ops.max_impl = choosing(ops.max_impl, ops.cmp_gt)


def _is_real(expression: Any) -> bool:
    kind = expression.ptr.get_rvalue_type()
    return bool(ti._lib.core.is_real(kind.element_type() if expression.is_tensor() else kind))


def tree_of(kernel: Any, arguments: Any, features: Any) -> tuple[Any, Any]:
    """Syntax tree of a kernel's source, and what Taichi walks through it with."""
    slots = kernel.template_slot_locations
    tree, context = ti.lang.kernel_impl._get_tree_and_ctx(
        kernel, args=arguments, excluded_parameters=slots, arg_features=features
    )
    return tree, context


def has_pending_fields() -> bool:
    """Whether there are fields that Taichi has not laid out yet."""
    return not (ti.lang.impl._root_fb.finalized or ti.lang.impl._root_fb.empty)


def check_real_functions() -> None:
    """Taichi 1.7's own bounds check leaves out what a `ti.real_func` reads and writes. An index there is
    asserted before its row is used, and made 0 where it is wrong, so that the process lives to tell."""
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
    """Where Taichi 1.7 checks bounds it prints a line for each whole number that overflows; hashes are to."""
    program = ti._lib.core.Program
    plain = program.compile_kernel

    def compiled(self: Any, config: Any, *arguments: Any) -> Any:
        config.debug = False  # the bounds check has a switch of its own; the rest looks here
        try:
            return plain(self, config, *arguments)
        finally:
            config.debug = True  # looked at by the launch, which raises what was found

    program.compile_kernel = compiled
