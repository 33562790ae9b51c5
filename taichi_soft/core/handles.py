"""Numbers of what a world gives out handles to: the same in every world with the same history."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from typing import Any, Protocol, TypeVar, cast
from weakref import WeakValueDictionary

from taichi_soft.core.threads import Turn, one_thread

Kind = TypeVar("Kind", bound="Handle")
Method = TypeVar("Method", bound=Callable[..., Any])


class Recorder(Protocol):
    """Who takes note of calls, where a world has one."""

    def call(
        self, method: Callable[..., Any], handle: Handle, arguments: tuple[Any, ...], options: dict[str, Any]
    ) -> Any:
        """Make a call, and take note of it."""


class Handle:
    """What a caller holds of a world: a body, a collider, a frame, a grab, an attachment; or the world.

    Its public methods are called by one thread at a time: a second one gets a StateError, before anything is
    changed.
    """

    _handles: Handles
    _serial: int

    def _keep(self) -> bytes | None:
        """Of a world only: as `keep`."""
        raise NotImplementedError

    def _undo(self, data: bytes) -> None:
        """Of a world only: as `undo`."""
        raise NotImplementedError

    def __init_subclass__(cls) -> None:
        """Guard the public methods."""
        for name, method in list(vars(cls).items()):
            if inspect.isfunction(method) and not name.startswith("_"):
                setattr(cls, name, one_thread(method))


class Handles:
    """Counts the handles of one world, and finds those that somebody still holds."""

    def __init__(self) -> None:
        """None yet; 0 is the world itself."""
        self.count = 1
        self.turn = Turn()
        self.recorder: Recorder | None = None
        self._known: WeakValueDictionary[int, Handle] = WeakValueDictionary()

    def enlist(self, handle: Handle, serial: int | None = None) -> None:
        """Give a new handle the next number, or the one that it had in an earlier state of the world."""
        if serial is None:
            serial = self.count
            self.count += 1
        handle._handles, handle._serial = self, serial
        self._known[serial] = handle

    def find(self, serial: int, kind: type[Kind]) -> Kind | None:
        """The handle of that number, if it is of that kind and somebody holds it."""
        handle = self._known.get(serial)
        return handle if isinstance(handle, kind) else None


def serial_of(handle: Handle) -> int:
    """Its number, 0 for the world."""
    return handle._serial


def handles_of(handle: Handle) -> Handles:
    """All handles of the same world."""
    return handle._handles


def keep(world: Handle) -> bytes | None:
    """A snapshot for `undo`, before changes for a step; None if no step of this world may be refused."""
    return world._keep()


def undo(world: Handle, data: bytes) -> None:
    """Put a world back to what it was since `keep`, where no step was made since.

    Unlike `World.restore` that keeps the events that wait, and does not count as another past.
    """
    world._undo(data)


def recorded(method: Method) -> Method:
    """Lets the recorder of a world that has one take note of the calls of a public method that changes it."""

    @wraps(method)
    def call(self: Handle, *arguments: Any, **options: Any) -> Any:
        recorder = self._handles.recorder
        if recorder is None:
            return method(self, *arguments, **options)
        return recorder.call(method, self, arguments, options)

    call.is_recorded = True  # type: ignore[attr-defined]
    return cast("Method", call)


def is_recorded(handle: Handle, name: str) -> bool:
    """Whether a handle has a method of that name that is recorded: what a file may ask for."""
    return hasattr(getattr(type(handle), name, None), "is_recorded")
