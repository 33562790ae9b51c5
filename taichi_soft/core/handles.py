"""Handles of a world. Worlds with the same history assign the same serial numbers to their handles."""

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
        """Call a method of a handle, record the call, and return the result of the method."""


class Handle:
    """Base class of public handles: the world, bodies, colliders, frames, grabs, attachments.

    Only one thread at a time can call public methods: a concurrent call raises a StateError before anything
    is changed.
    """

    _handles: Handles
    _serial: int

    def _keep(self) -> bytes | None:
        """Return a snapshot for the function `keep`. Only worlds implement this method."""
        raise NotImplementedError

    def _undo(self, data: bytes) -> None:
        """Restore a snapshot for the function `undo`. Only worlds implement this method."""
        raise NotImplementedError

    def __init_subclass__(cls) -> None:
        """Guard the public methods against concurrent calls."""
        for name, method in list(vars(cls).items()):
            if inspect.isfunction(method) and not name.startswith("_"):
                setattr(cls, name, one_thread(method))


class Handles:
    """Registry that numbers the handles of a world and finds the handles that still exist."""

    def __init__(self) -> None:
        """Start without handles. Number 0 is reserved for the world itself."""
        self.count = 1
        self.turn = Turn()
        self.recorder: Recorder | None = None
        self._known: WeakValueDictionary[int, Handle] = WeakValueDictionary()

    def enlist(self, handle: Handle, serial: int | None = None) -> None:
        """Assign a serial number to a new handle.

        Args:
            handle: handle to register.
            serial: number of the handle in an earlier state of the world; None for the next free number.
        """
        if serial is None:
            serial = self.count
            self.count += 1
        handle._handles, handle._serial = self, serial
        self._known[serial] = handle

    def find(self, serial: int, kind: type[Kind]) -> Kind | None:
        """Return the handle with a serial number, or None if it no longer exists or is not of type `kind`."""
        handle = self._known.get(serial)
        return handle if isinstance(handle, kind) else None


def serial_of(handle: Handle) -> int:
    """Return the serial number of a handle; 0 for the world."""
    return handle._serial


def handles_of(handle: Handle) -> Handles:
    """Return the registry of all handles of the world to which `handle` belongs."""
    return handle._handles


def keep(world: Handle) -> bytes | None:
    """Return a snapshot for `undo`. Call this function before the changes for the next step.

    Return None if the world never refuses a step, because `undo` is then not needed.
    """
    return world._keep()


def undo(world: Handle, data: bytes) -> None:
    """Restore the snapshot that `keep` returned. The world must not have made a step since then.

    Unlike `World.restore`, this function keeps waiting events and does not change `restore_count`.
    """
    world._undo(data)


def recorded(method: Method) -> Method:
    """Decorate a public method that changes a world. The recorder of the world, if any, records each call."""

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
