"""Exclude concurrent calls. A world refuses a concurrent call. A function that uses Taichi waits."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from functools import wraps
from threading import get_ident
from typing import Any, NoReturn, TypeVar, cast

from taichi_soft.core.errors import StateError

Function = TypeVar("Function", bound=Callable[..., Any])

_taichi = threading.RLock()
_left_in: int | None = None  # id of the parent process if it ran Taichi before the fork; else None


def thread_name(ident: int) -> str:
    """Return the name of a thread for messages."""
    names = [each.name for each in threading.enumerate() if each.ident == ident]
    return f"thread {names[0]!r}" if names else "a thread that has ended"


class Turn:
    """Exclusive access of one thread to a world and its handles."""

    __slots__ = ("holder", "lock")

    def __init__(self) -> None:
        """Start without a holder. Raises: StateError of `require_here` in a forked process."""
        require_here()
        self.lock = threading.Lock()
        self.holder = 0  # id of the thread with access, 0 for none

    def refuse(self) -> NoReturn:
        """Raise a StateError that names this thread and the thread with access.

        In a forked process, raise the StateError of `require_here`.
        """
        require_here()
        here, there = thread_name(get_ident()), thread_name(self.holder)
        raise StateError(
            f"{here} called this world while {there} was in a call of it: use a threading.Lock, so that "
            "only one thread at a time calls a world"
        )


def one_thread(method: Function) -> Function:
    """Decorate a method of a handle, so that it raises a StateError while another thread runs a decorated
    method of the same world. Calls within one thread can be nested.
    """

    @wraps(method)
    def call(
        self: Any, *arguments: Any, **options: Any
    ) -> Any:  # no helper functions: games make hundreds of calls per frame
        turn, here = self._handles.turn, get_ident()
        if turn.holder == here:
            return method(self, *arguments, **options)
        if _left_in is not None or not turn.lock.acquire(False):
            turn.refuse()
        turn.holder = here
        try:
            return method(self, *arguments, **options)
        finally:
            turn.holder = 0
            turn.lock.release()

    return cast("Function", call)


def in_turn(function: Function) -> Function:
    """Decorate a function that uses Taichi, so that it waits until no other thread runs a decorated function.

    To avoid deadlocks, a decorated function must not call user code.
    """

    @wraps(function)
    def call(*arguments: Any, **options: Any) -> Any:
        if _left_in is not None:
            require_here()
        with _taichi:
            return function(*arguments, **options)

    return cast("Function", call)


def require_here() -> None:
    """Raise a StateError if this process was forked from a process in which Taichi runs."""
    if _left_in is not None:
        raise StateError(
            f"process {os.getpid()} was forked from process {_left_in} after Taichi had started there, and "
            "has none of its threads: start processes with multiprocessing.get_context('spawn'), or fork "
            "before taichi_soft.init()"
        )


def leave_behind(process: int) -> None:
    """Record in a forked process the id of the parent process, in which Taichi runs."""
    global _left_in
    _left_in = process
