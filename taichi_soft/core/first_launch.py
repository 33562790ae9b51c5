"""First launch of kernels: load them from the known kernels, or compile them from source."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from taichi_soft.core.compilation import BURST
from taichi_soft.core.known_kernels import (
    FLAG,
    KnownKernels,
    UnknownPartError,
    digest_of,
    name_of,
    short_body,
    short_name_of,
)
from taichi_soft.core.taichi_patches import ti, tree_of

kernels = ti.lang.kernel_impl
Make = Callable[..., None]


class FirstLaunches:
    """First launches of all kernels of a process."""

    def __init__(self) -> None:
        self._known: KnownKernels | None = None
        self._flag: Any = None
        self._made: list[tuple[Any, Any, str]] = []  # kernel, features of its arrays, digest

    def make_flag(self) -> None:
        """Make the field that short bodies set, when Taichi starts."""
        self._flag = ti.field(ti.i32, ())

    def open(self, known: KnownKernels) -> None:
        """Start to look up kernels among the known ones."""
        self._known = known

    @contextmanager
    def making_anew(self, functions: set[Any]) -> Iterator[None]:
        """Context in which these kernels are compiled from source, even if they are known or compiled."""
        known, self._known = self._known, None
        made = [vars(function)["_primal"] for function in functions]  # Taichi's kernel objects
        before = [(kernel, kernel.compiled_kernels) for kernel in made]
        for kernel in made:
            kernel.compiled_kernels = {}
        try:
            yield
        finally:
            self._known = known
            for kernel, compiled in before:
                kernel.compiled_kernels = compiled

    def install(self) -> None:
        """Hook into Taichi."""
        plain = kernels.Kernel.materialize

        def materialize(kernel: Any, key: Any = None, args: Any = None, arg_features: Any = None) -> None:
            if key not in kernel.compiled_kernels:
                self._prepare(kernel, plain, key, args, arg_features)

        kernels.Kernel.materialize = materialize

    def close(self) -> None:
        """Let Taichi store a file with a short body for each kernel compiled from source."""
        for kernel, features, digest in self._made:
            program = ti.lang.impl.get_runtime().prog
            short = self._create_short(kernel, features, digest)
            program.compile_kernel(program.config(), program.get_device_caps(), short)
        if self._made:
            _ = self._flag[None]  # reading it is a kernel too, which the next process needs

    def keep(self) -> None:
        """Copy the code of these kernels into the files of the short bodies. Call it after Taichi's end."""
        if self._known is not None:
            self._known.keep({digest: name_of(kernel, digest) for kernel, _, digest in self._made})

    def _prepare(self, kernel: Any, plain: Make, key: Any, args: Any, features: Any) -> None:
        """Make a kernel, and intercept its first launch."""
        name = kernel.func.__name__
        start = BURST.begin(name)
        kernel.runtime.materialize()  # lays out fields, whose positions are part of digests
        digest = self._digest_of(kernel, args, features)
        is_short = self._known is not None and digest in self._known
        if digest is None:
            plain(kernel, key, args, features)
        elif is_short:
            kernel.compiled_kernels[key] = self._create_short(kernel, features, digest)
        else:
            self._make(kernel, key, args, features, digest)
        is_found = is_short

        def launch_first(compiled: Any, *given: Any) -> Any:
            nonlocal is_found
            del kernel.launch_kernel  # later launches use the method of the class
            try:
                found = kernel.launch_kernel(compiled, *given)
                if (
                    is_short and digest is not None and self._flag[None] != 0
                ):  # the short body has no other effect
                    self._flag[None], is_found = 0, False
                    self._make(kernel, key, args, features, digest)
                    found = kernel.launch_kernel(kernel.compiled_kernels[key], *given)
                return found
            finally:
                BURST.end(name, start, is_found)

        kernel.launch_kernel = launch_first

    def _digest_of(self, kernel: Any, args: Any, features: Any) -> str | None:
        """Digest of a kernel, or None if it cannot be known."""
        is_ours = kernel.func.__module__.startswith("taichi_soft.")
        if self._known is None or not is_ours or kernel.autodiff_mode != kernels.AutodiffMode.NONE:
            return None
        slots = kernel.template_slot_locations
        given = [(args[i] if i in slots else features[i], i in slots) for i in range(len(args))]
        try:
            return digest_of(kernel.func, self._known.options, given)
        except UnknownPartError:
            return None

    def _make(self, kernel: Any, key: Any, args: Any, features: Any, digest: str) -> None:
        """Compile a kernel from source, under a name that identifies its file."""
        tree, context = tree_of(kernel, args, features)
        kernel.compiled_kernels[key] = _create(kernel, tree, context, name_of(kernel, digest))
        self._made.append((kernel, features, digest))

    def _create_short(self, kernel: Any, features: Any, digest: str) -> Any:
        """Make a kernel with the same arguments and a short body."""
        names = [argument.name for argument in kernel.arguments]
        lines = [""] * 32
        function = ast.FunctionDef(
            name=kernel.func.__name__,
            args=ast.arguments(
                posonlyargs=[],
                args=[ast.arg(arg=name) for name in names],
                kwonlyargs=[],
                kw_defaults=[],
                defaults=[],
            ),
            body=short_body(digest),
            decorator_list=[],
            returns=ast.Constant(value=None) if kernel.return_type else None,
        )
        tree = ast.fix_missing_locations(ast.Module(body=[function], type_ignores=[]))
        context = kernels.ASTTransformerContext(
            excluded_parameters=kernel.template_slot_locations,
            is_kernel=True,
            func=kernel,
            arg_features=features,
            global_vars={FLAG: self._flag, **dict.fromkeys(names)},
            argument_data=None,
            src=lines,
            start_lineno=1,
            file=__file__,
        )
        return _create(kernel, tree, context, short_name_of(digest))


def _create(kernel: Any, tree: Any, context: Any, name: str) -> Any:
    """Create Taichi's kernel from a function's syntax tree, as `Kernel.materialize` of Taichi 1.7 does."""
    runtime = kernel.runtime

    def taichi_ast_generator(made: Any) -> None:  # Taichi requires this name
        kernel.kernel_cpp = made
        runtime.inside_kernel, runtime.current_kernel = True, kernel
        assert runtime.compiling_callable is None
        runtime.compiling_callable = made
        try:
            context.ast_builder = made.ast_builder()
            kernels.transform_tree(tree, context)
        finally:
            runtime.inside_kernel, runtime.current_kernel, runtime.compiling_callable = False, None, None

    return runtime.prog.create_kernel(taichi_ast_generator, name, kernel.autodiff_mode)


FIRST_LAUNCHES = FirstLaunches()
