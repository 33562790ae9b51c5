"""Read the source of kernels and functions once.

When a function is defined, Taichi reads the lines around the function. This reading takes more than half of
the time to import this package. Taichi reads the whole source again for every call of a `ti.func`, and
formats the lines around every expression for a possible message.

This file is unnecessary once Taichi's `_inside_class` reads no source and `get_pos_info` caches its results.
The main branch does neither. https://github.com/taichi-dev/taichi/issues/7711 asked for a faster import.
Quadrants, a fork of Taichi, works on both faults: https://github.com/Genesis-Embodied-AI/quadrants/pull/804.
"""

from __future__ import annotations

import functools
import sys
import textwrap
import types
import weakref
from collections.abc import Callable
from typing import Any

from taichi_soft.core.taichi_workarounds.importing import ti


def read_sources_once() -> None:
    """Make Taichi read the source of a function only once, when the function is first compiled.

    Messages of Taichi then show only the first line of an expression.
    """
    kernels = ti.lang.kernel_impl
    ti.lang.kernel_impl._inside_class = _is_in_class
    kernels.getsourcefile = _remember(kernels.getsourcefile)
    kernels.getsourcelines = _remember(kernels.getsourcelines)
    kernels.textwrap = types.SimpleNamespace(
        fill=functools.cache(textwrap.fill), dedent=functools.cache(textwrap.dedent)
    )
    ti.lang.ast.ast_transformer_utils.ASTTransformerContext.get_pos_info = _place_of


def _is_in_class(level_of_class_stackframe: int) -> bool:
    """True if a decorated function is defined in the body of a class.

    Args:
        level_of_class_stackframe: number of frames from the frame of this function to the frame with the
            class statement, which Taichi reads. The frame before that frame is the body of the class.
    """
    return "__qualname__" in sys._getframe(level_of_class_stackframe - 1).f_locals


def _remember(look_up: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return `look_up` with a cache that keeps the result for an object as long as the object exists."""
    known: weakref.WeakKeyDictionary[Any, Any] = weakref.WeakKeyDictionary()

    def remembered(key: Any) -> Any:
        if key not in known:
            known[key] = look_up(key)
        return known[key]

    return remembered


def _place_of(context: Any, node: Any) -> str:
    """Describe the position of a node in a source: file, line number, function, line, and a mark below the
    node.
    """
    number, line = node.lineno + context.lineno_offset, context.src[node.lineno - 1].rstrip()
    start = context.indent + node.col_offset
    end = context.indent + node.end_col_offset if node.end_lineno == node.lineno else len(line)
    mark = " " * start + "^" * (end - start)
    return f'File "{context.file}", line {number}, in {context.func.func.__name__}:\n{line}\n{mark}\n'
