"""Find the kernels that an earlier process compiled, without processing their source.

Taichi stores compiled kernels on disk under a hash of its intermediate code. To compute that hash, Taichi
processes the source of each kernel at every start. With a full cache, this takes most of the time of a start.

Here, a known kernel is created with a short body instead. The short body contains a digest of everything that
the kernel's code depends on. When the process that compiled the kernel ends, the kernel's code is stored in
the file of the short body. Taichi finds that file by the hash of the short body. This hash is quick to
compute.

If Taichi does not find the file, it compiles the short body itself. The short body only sets a flag. If the
flag is set after the launch, the kernel is created from its source and launched.

This file is unnecessary once Taichi looks for a kernel before it processes the kernel's source. Quadrants, a
fork of Taichi, does this (https://github.com/Genesis-Embodied-AI/quadrants/pull/131). The main branch does
not. https://github.com/taichi-dev/taichi/issues/4401 planned the change.
"""

from __future__ import annotations

import ast
import json
import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from taichi_soft.core.compilation import BURST
from taichi_soft.core.taichi_workarounds.importing import ti
from taichi_soft.core.taichi_workarounds.kernel_digest import UnknownPartError, digest_of

kernels = ti.lang.kernel_impl
Make = Callable[..., None]

INDEX = "taichi_soft.json"
"""Name of the file that contains the digests of known kernels. The file is in the folder of Taichi's own
files."""

FLAG = "__flag"
"""Name of the flag in the source of the short body. The flag is a field that the short body sets."""

HEADER = 1 << 17
"""Number of bytes that are read from the start of a kernel's file. They contain the names of the kernel's
functions."""


class KnownKernels:
    """Known kernels in one of the folders in which Taichi stores kernels."""

    def __init__(self, folder: Path, options: str) -> None:
        """Read the index of a folder.

        Args:
            folder: folder in which Taichi stores kernels.
            options: see `digest_of`.
        """
        self.folder, self.options = folder, options
        self._known = self._read()

    def __contains__(self, digest: object) -> bool:
        return digest in self._known

    def _read(self) -> set[str]:
        try:
            return set(json.loads((self.folder / INDEX).read_text()))
        except (OSError, ValueError, TypeError):
            return set()

    def keep(self, names: dict[str, str]) -> None:
        """Copy the code of kernels to the files of their short bodies. Taichi must have written its files.

        Args:
            names: names of the kernels that were created from their source, by digest.
        """
        files = self._files_of({*names.values(), *map(_short_name_of, names)})
        kept = []
        for digest, name in names.items():
            code, place = files.get(name), files.get(_short_name_of(digest))
            if code and place:
                _write(place, code.read_bytes())
                kept.append(digest)
        if kept:
            _write(self.folder / INDEX, json.dumps(sorted({*self._read(), *kept})).encode())

    def _files_of(self, names: set[str]) -> dict[str, Path]:
        """Return the files of the kernels with these names, by name."""
        found = {}
        for path in self.folder.glob("*.tic"):
            with path.open("rb") as file:
                match = re.search(rb'"name":"(\w+?)_kernel_\d+_', file.read(HEADER))
            if match and match.group(1).decode() in names:
                found[match.group(1).decode()] = path
        return found


class FirstLaunches:
    """Prepares each kernel of a process at its first launch.

    A kernel that an earlier process compiled gets the short body; any other is created from its source.
    """

    def __init__(self) -> None:
        self._known: KnownKernels | None = None
        self._flag: Any = None
        self._made: list[tuple[Any, Any, str]] = []  # kernel, features of array arguments, digest

    def make_flag(self) -> None:
        """Create the flag that short bodies set. Call this when Taichi starts."""
        self._flag = ti.field(ti.i32, ())

    def open(self, known: KnownKernels) -> None:
        """Start to look for kernels in `known`."""
        self._known = known

    @contextmanager
    def making_anew(self, functions: set[Any]) -> Iterator[None]:
        """Context in which kernels are created from their source, even if they are known or exist already."""
        known, self._known = self._known, None
        made = [vars(function)["_primal"] for function in functions]  # the Taichi object behind each function
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
        """Replace Taichi's function that creates a kernel, so that known kernels get the short body."""
        plain = kernels.Kernel.materialize

        def materialize(kernel: Any, key: Any = None, args: Any = None, arg_features: Any = None) -> None:
            if key not in kernel.compiled_kernels:
                self._prepare(kernel, plain, key, args, arg_features)

        kernels.Kernel.materialize = materialize

    def close(self) -> None:
        """Make Taichi store a file with the short body of each kernel that was created from its source."""
        for kernel, features, digest in self._made:
            program = ti.lang.impl.get_runtime().prog
            short = self._create_short(kernel, features, digest)
            program.compile_kernel(program.config(), program.get_device_caps(), short)
        if self._made:
            _ = self._flag[None]  # compiles the kernel that reads the flag: the next process needs it

    def keep(self) -> None:
        """Store the code of kernels that were created from their source in the files of their short bodies.

        Call this after Taichi has ended.
        """
        if self._known is not None:
            self._known.keep({digest: _name_of(kernel, digest) for kernel, _, digest in self._made})

    def _prepare(self, kernel: Any, plain: Make, key: Any, args: Any, features: Any) -> None:
        """Create a kernel. If it has the short body, make its first launch check the flag."""
        name = kernel.func.__name__
        start = BURST.begin(name)
        kernel.runtime.materialize()  # lays out fields, because digests contain their addresses
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
            del kernel.launch_kernel  # from now on, the method of the class is used
            try:
                found = kernel.launch_kernel(compiled, *given)
                if is_short and digest is not None and self._flag[None] != 0:  # only the short body ran
                    self._flag[None], is_found = 0, False
                    self._make(kernel, key, args, features, digest)
                    found = kernel.launch_kernel(kernel.compiled_kernels[key], *given)
                return found
            finally:
                BURST.end(name, start, is_found)

        kernel.launch_kernel = launch_first

    def _digest_of(self, kernel: Any, args: Any, features: Any) -> str | None:
        """Return the digest of a kernel, or None if it has no digest."""
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
        """Create a kernel from its source, with a name by which its file can be found."""
        slots = kernel.template_slot_locations
        tree, context = ti.lang.kernel_impl._get_tree_and_ctx(
            kernel, args=args, excluded_parameters=slots, arg_features=features
        )
        kernel.compiled_kernels[key] = _create(kernel, tree, context, _name_of(kernel, digest))
        self._made.append((kernel, features, digest))

    def _create_short(self, kernel: Any, features: Any, digest: str) -> Any:
        """Create a kernel that has the short body, but the arguments of `kernel`."""
        names = [argument.name for argument in kernel.arguments]
        returned = " -> None" if kernel.return_type else ""
        head = f"def {kernel.func.__name__}({', '.join(names)}){returned}:"
        lines = [head, *(f"    {statement}" for statement in _short_body(digest))]
        tree = ast.parse("\n".join(lines))
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
        return _create(kernel, tree, context, _short_name_of(digest))


def _create(kernel: Any, tree: Any, context: Any, name: str) -> Any:
    """Create Taichi's own kernel from the syntax tree of a function, as Taichi's `Kernel.materialize`
    does.
    """
    runtime = kernel.runtime

    def taichi_ast_generator(made: Any) -> None:  # Taichi looks for this name
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


def _short_body(digest: str) -> list[str]:
    """Return statements that set the flag to each part of the digest, and then to 1.

    The parts are large, because each statement takes time at every start.
    """
    words = np.frombuffer(bytes.fromhex(digest), np.int32)
    return [f"{FLAG}[None] = {word}" for word in (*words.tolist(), 1)]


def _name_of(kernel: Any, digest: str) -> str:
    """Return the name, in Taichi's files, of a kernel that is created from its source."""
    return f"{kernel.func.__name__}_{digest}"


def _short_name_of(digest: str) -> str:
    """Return the name, in Taichi's files, of a kernel with the short body."""
    return f"known_{digest}"


def _write(path: Path, contents: bytes) -> None:
    """Replace a file in one operation, because other processes can read the file at the same time."""
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    part.write_bytes(contents)
    part.replace(path)


FIRST_LAUNCHES = FirstLaunches()
