"""The flight recorder: the calls and steps of the last ticks, and the snapshot before them.

A recording holds at least as many ticks as were asked for, and less than twice as many: a snapshot is taken
every so many ticks, and the last two stretches are kept. Ticks that `restore` has undone are not in it. It is
plain data, with the assets and shapes that it needs, so that `replay` can build the world again anywhere.
"""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.contact.shapes import Shape
from taichi_soft.core.checks import as_path
from taichi_soft.core.container import name_of_sealed, seal, unseal
from taichi_soft.core.errors import SnapshotError, TaichiSoftError
from taichi_soft.core.handles import Handle, serial_of
from taichi_soft.core.serialisation import as_plain, digest_of, from_json, plain_of, to_json
from taichi_soft.persistence.snapshot import state_hash, take_snapshot
from taichi_soft.persistence.world_structure import asset_digest
from taichi_soft.solver.context import WorldContext

MARK, VERSION = b"TSOFTREC", 1

MOST_CONTENT = 1 << 28
"""Bytes of a recording beside its snapshot, before they are compressed, which may make a thousandth of them:
without a limit a file of some MB could fill the memory."""

Pushes = list[tuple[int, NDArray[np.float32]]]
"""Of a force field in one step: bodies by their serial numbers, accelerations (n, 3) [m/s^2]."""


@dataclass
class _Stretch:
    """A snapshot, and what was done since."""

    snapshot: bytes
    entries: list[list[Any]] = field(default_factory=list)  # calls and steps
    marks: dict[bytes, int] = field(default_factory=dict)  # entries before a snapshot of each name was taken
    steps: int = 0

    def __post_init__(self) -> None:
        self.mark(self.snapshot)

    def mark(self, snapshot: bytes) -> None:
        """It is possible to go back to here."""
        self.marks[name_of_sealed(snapshot)] = len(self.entries)

    def go_back(self, name: bytes) -> None:
        """What was done after the snapshot of that name was not."""
        end = self.marks[name]
        del self.entries[end:]
        self.marks = {name: at for name, at in self.marks.items() if at <= end}
        self.steps = sum(entry[0] == "step" for entry in self.entries)


class Recorder:
    """Takes notes of what is done to one world."""

    def __init__(self, context: WorldContext, ticks: int, path: Path) -> None:
        """Begins now, with a built world. `path`: where it writes where a body freezes."""
        self._ticks, self._path = ticks, path
        self._before: _Stretch | None = None
        self._present = _Stretch(take_snapshot(context))
        self._is_inside = False
        self._has_written = False
        self.pushes: Pushes = []  # of a force field in the coming step

    def call(
        self, method: Callable[..., Any], handle: Handle, arguments: tuple[Any, ...], options: dict[str, Any]
    ) -> Any:
        """Make a call and note it, unless it is refused or another one makes it."""
        if self._is_inside:
            return method(handle, *arguments, **options)
        kept = [[_kept(each) for each in arguments], {name: _kept(each) for name, each in options.items()}]
        self._is_inside = True
        try:
            found = method(handle, *arguments, **options)
        finally:
            self._is_inside = False
        self._present.entries.append(["call", serial_of(handle), method.__name__, *kept])
        return found

    def note_step(
        self, context: WorldContext, seconds: float, substeps: int, *, is_broken: bool
    ) -> list[str]:
        """Note a step that was made, and the name of the state after it; write all where a body froze in it.

        Returns: what to tell the user.
        """
        pushes = [[serial, rows] for serial, rows in self.pushes]
        self.pushes = []
        self._present.entries.append(["step", seconds, substeps, state_hash(context), pushes])
        self._present.steps += 1
        told = [self._write(context)] if is_broken and not self._has_written else []
        if self._present.steps >= self._ticks:
            self._before, self._present = self._present, _Stretch(take_snapshot(context))
        return told

    def _write(self, context: WorldContext) -> str:
        self._has_written = True
        try:
            file = self.save(context, self._path)
        except SnapshotError as error:
            return f"no recording: {error}"
        return f"`taichi-soft replay {file}` shows how it came to that"

    def note_snapshot(self, snapshot: bytes) -> None:
        """Note that one was taken now."""
        self._present.mark(snapshot)

    def go_back(self, context: WorldContext, snapshot: bytes) -> None:
        """Note that `World.restore` has undone what was done since; begin again where that was not here."""
        name = name_of_sealed(snapshot)
        self.pushes = []
        if name in self._present.marks:
            self._present.go_back(name)
        elif self._before is not None and name in self._before.marks:
            self._before.go_back(name)
            self._present, self._before = self._before, None
        else:
            self._before, self._present = None, _Stretch(take_snapshot(context))

    def content(self, context: WorldContext) -> bytes:
        """The recording as it stands."""
        first = self._before or self._present
        entries = [*(self._before.entries if self._before else []), *self._present.entries]
        shapes = {name: plain_of(shape) for name, shape in context.colliders.shapes.items()}
        assets = {asset_digest(asset): asset for asset in context.slots.kinds}
        made_of = {
            "world": _world_options(context),
            "slots": [asset_digest(asset) for asset in context.slots.assets],
            "assets": {name: _asset_options(asset) for name, asset in assets.items()},
            "shapes": shapes,
            "built_with": context.built_with,
            "entries": [[as_plain(each) for each in entry[:3]] + _plain(entry[3:]) for entry in entries],
        }
        plain = to_json(made_of)
        if len(plain) > MOST_CONTENT:
            raise SnapshotError(
                f"the recording takes {len(plain) >> 20} MB, and no more than {MOST_CONTENT >> 20} are kept: "
                "make the world with a smaller record"
            )
        return seal(MARK, VERSION, [zlib.compress(plain, 1), first.snapshot])

    def save(self, context: WorldContext, path: Any) -> Path:
        """As `World.save_recording`."""
        file = as_path(path)
        content = self.content(context)
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)
        except OSError as error:
            raise SnapshotError(f"cannot write {str(file)!r}: {error.strerror or error}") from None
        return file


def read_recording(path: Any) -> tuple[dict[str, Any], bytes]:
    """What the world was made of and what was done, and the snapshot before. Raises: SnapshotError."""
    file = as_path(path)
    try:
        data = file.read_bytes()
    except OSError as error:
        raise SnapshotError(f"cannot read {str(file)!r}: {error.strerror or error}") from None
    if data[:1] == b"{":
        return _read_played(data)
    return _read_sealed(data)


def _read_played(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Read what a page saved: a recording, and what the visitor did in place of its steps."""
    try:
        played = json.loads(data)
        made_of, snapshot = _read_sealed(base64.b64decode(played["start"], validate=True))
        before = takewhile(lambda entry: entry[0] == "call", made_of["entries"])
        return {**made_of, "entries": [*before, *played["entries"]]}, snapshot
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        if isinstance(error, TaichiSoftError):
            raise
        raise SnapshotError(
            f"this is no file that a page saved, or it is cut off or damaged ({error!r}): save it again there"
        ) from None


def _read_sealed(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Read what `Recorder.save` wrote."""
    parts = unseal(data, MARK, VERSION, "recording")
    try:
        content, snapshot = parts
        inflating = zlib.decompressobj()
        plain = inflating.decompress(content, MOST_CONTENT)
        if not inflating.eof:
            raise SnapshotError(f"it is cut off, or takes more than {MOST_CONTENT >> 20} MB")
        made_of = from_json(plain)
    except (ValueError, zlib.error) as error:
        raise SnapshotError(f"this recording is not in order: {error}") from None
    return made_of, bytes(snapshot)


def _world_options(context: WorldContext) -> dict[str, Any]:
    """Arguments of `World`, beside what the snapshot holds."""
    chosen = context.settings
    names = (
        "restitution",
        "friction",
        "integrator",
        "tolerance",
        "most_iterations",
        "schedule",
        "floor",
        "retries",
    )
    return {
        **{name: as_plain(getattr(chosen, name)) for name in names},
        "gravity": chosen.gravity.tolist(),
        "soft_contact": context.contact.soft,
        "sleep_speed": context.contact.sleep_speed,
        "collider_room": context.contact.collider_room,
        "sample_room": context.contact.sample_room,
    }


def _asset_options(asset: SoftBodyAsset) -> dict[str, Any]:
    """Arguments of `SoftBodyAsset`."""
    names = ("law", "strain", "flips", "damping_model", "spare_vertices")
    return {
        "mesh": plain_of(asset.mesh),
        "material": plain_of(asset.material),
        "pinned": asset.description.pinned.tolist(),
        "contact": as_plain(asset.contact),
        "plasticity": as_plain(asset.plasticity),
        "tearing": as_plain(asset.tearing),
        "hull": None if asset.hull is None else plain_of(asset.hull),
        "coarser": [_asset_options(each) for each in asset.coarser],
        **{name: as_plain(getattr(asset, name)) for name in names},
    }


def _kept(value: Any) -> Any:
    """A copy of an argument that nobody changes any more."""
    if isinstance(value, np.ndarray):
        return value.copy()
    if isinstance(value, (list, tuple)):
        return [_kept(each) for each in value]
    return value


def _plain(value: Any) -> Any:
    """An argument as plain data; handles by number, assets and shapes by their digests."""
    if isinstance(value, Handle):
        return {"handle": serial_of(value)}
    if isinstance(value, SoftBodyAsset):
        return {"part": asset_digest(value)}
    if isinstance(value, Shape):
        return {"part": digest_of(value)}
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    if isinstance(value, dict):
        return {"options": {name: _plain(each) for name, each in value.items()}}
    return as_plain(value)
