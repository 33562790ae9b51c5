"""Handles of a world. Their serial numbers are equal in worlds with the same history."""

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
    """Recorder of API calls."""

    def call(
        self, method: Callable[..., Any], handle: Handle, arguments: tuple[Any, ...], options: dict[str, Any]
    ) -> Any:
        """Make a call and record it."""


class Handle:
    """Base class of public handles: the world, bodies, colliders, frames, grabs, attachments.

    Only one thread at a time can call public methods: a concurrent call raises a StateError before anything
    is changed.
    """

    _handles: Handles
    _serial: int

    def _keep(self) -> bytes | None:
        """Return a snapshot as `keep` does. Only worlds implement this."""
        raise NotImplementedError

    def _undo(self, data: bytes) -> None:
        """Restore a snapshot as `undo` does. Only worlds implement this."""
        raise NotImplementedError

    def __init_subclass__(cls) -> None:
        """Guard the public methods against concurrent calls."""
        for name, method in list(vars(cls).items()):
            if inspect.isfunction(method) and not name.startswith("_"):
                setattr(cls, name, one_thread(method))


class Handles:
    """Numbers the handles of a world, and finds those that still exist."""

    def __init__(self) -> None:
        """Start without handles. Number 0 is the world itself."""
        self.count = 1
        self.turn = Turn()
        self.recorder: Recorder | None = None
        self._known: WeakValueDictionary[int, Handle] = WeakValueDictionary()

    def enlist(self, handle: Handle, serial: int | None = None) -> None:
        """Assign a number to a new handle: the next one, or `serial`, its number in an earlier state of the
        world.
        """
        if serial is None:
            serial = self.count
            self.count += 1
        handle._handles, handle._serial = self, serial
        self._known[serial] = handle

    def find(self, serial: int, kind: type[Kind]) -> Kind | None:
        """Return the handle with a number, or None if it no longer exists or has another type."""
        handle = self._known.get(serial)
        return handle if isinstance(handle, kind) else None


def serial_of(handle: Handle) -> int:
    """Return the number of a handle; 0 for the world."""
    return handle._serial


def handles_of(handle: Handle) -> Handles:
    """Return all handles of the same world."""
    return handle._handles


def keep(world: Handle) -> bytes | None:
    """Return a snapshot for `undo`, before changes for a step; None if this world refuses no step."""
    return world._keep()


def undo(world: Handle, data: bytes) -> None:
    """Restore the state of a world at `keep`. No step must have been made since.

    Unlike `World.restore`, this keeps waiting events and does not change `restore_count`.
    """
    world._undo(data)


def recorded(method: Method) -> Method:
    """Decorate a public method that changes a world. If the world has a recorder, it records the calls."""

    @wraps(method)
    def call(self: Handle, *arguments: Any, **options: Any) -> Any:
        recorder = self._handles.recorder
        if recorder is None:
            return method(self, *arguments, **options)
        return recorder.call(method, self, arguments, options)

    call.is_recorded = True  # type: ignore[attr-defined]
    return cast("Method", call)


def is_recorded(handle: Handle, name: str) -> bool:
    """True if a handle has a recorded method with this name. Only such methods can be called from files."""
    return hasattr(getattr(type(handle), name, None), "is_recorded")
