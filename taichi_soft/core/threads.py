"""One thread at a time: in a world, where a second one is refused, and in Taichi, where it waits."""

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
_left_in: int | None = None  # the process in which Taichi runs, where this one was forked from it


def thread_name(ident: int) -> str:
    """A thread, as messages call it."""
    names = [each.name for each in threading.enumerate() if each.ident == ident]
    return f"thread {names[0]!r}" if names else "a thread that is over"


class Turn:
    """Of one thread, to call a world and its handles."""

    __slots__ = ("holder", "lock")

    def __init__(self) -> None:
        """Raises: StateError as `require_here`."""
        require_here()
        self.lock = threading.Lock()
        self.holder = 0  # ident of the thread whose turn it is, 0 for nobody's

    def refuse(self) -> NoReturn:
        """Raises: StateError that names this thread and the one whose turn it is; or as `require_here`."""
        require_here()
        here, there = thread_name(get_ident()), thread_name(self.holder)
        raise StateError(
            f"{here} called this world while {there} was in a call of it: let one thread at a time call a "
            "world, by a threading.Lock round the calls of each"
        )


def one_thread(method: Function) -> Function:
    """Lets a method of a handle begin only while no other thread is in one; it may call others."""

    @wraps(method)
    def call(self: Any, *arguments: Any, **options: Any) -> Any:  # in line, as games call it by the hundred
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
    """Lets a function that uses Taichi wait until no other thread is in one.

    Such a function calls nothing of the user's, so that nobody waits for ever.
    """

    @wraps(function)
    def call(*arguments: Any, **options: Any) -> Any:
        if _left_in is not None:
            require_here()
        with _taichi:
            return function(*arguments, **options)

    return cast("Function", call)


def require_here() -> None:
    """Raises: StateError in a process that was forked from one where Taichi runs."""
    if _left_in is not None:
        raise StateError(
            f"process {os.getpid()} was forked from process {_left_in} after Taichi had started there, and "
            "has none of its threads: start processes by multiprocessing.get_context('spawn'), or fork "
            "before taichi_soft.init()"
        )


def leave_behind(process: int) -> None:
    """Note that Taichi runs in another process, which this one was forked from."""
    global _left_in
    _left_in = process
