"""Flight recorder: records the calls and steps of the last ticks, and a snapshot of the state before them.

A recording contains at least the requested number of ticks, and less than twice this number. The recorder
takes a snapshot whenever the requested number of ticks has passed, and keeps the last two segments. It
removes ticks that `restore` undid. A recording is plain data and contains its assets and shapes, so that
`replay` can rebuild the world on any machine.
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

MAX_CONTENT = 1 << 28
"""Largest uncompressed size of a recording without its snapshot [bytes]. Compressed data can be a thousand
times smaller, so that without this limit a small file could fill the memory."""

FieldAccelerations = list[tuple[int, NDArray[np.float32]]]
"""Accelerations that the force field gave in one step. Each pair is a body's serial number and the
accelerations of its vertices, (n, 3) [m/s^2]."""


@dataclass
class _Segment:
    """A snapshot and the calls and steps after it."""

    snapshot: bytes
    entries: list[list[Any]] = field(default_factory=list)  # calls and steps
    marks: dict[bytes, int] = field(default_factory=dict)  # number of entries before each named snapshot
    steps: int = 0

    def __post_init__(self) -> None:
        self.mark(self.snapshot)

    def mark(self, snapshot: bytes) -> None:
        """Mark a snapshot as a state to which `rewind` can return."""
        self.marks[name_of_sealed(snapshot)] = len(self.entries)

    def rewind(self, name: bytes) -> None:
        """Remove the entries after the snapshot with this name."""
        end = self.marks[name]
        del self.entries[end:]
        self.marks = {name: at for name, at in self.marks.items() if at <= end}
        self.steps = sum(entry[0] == "step" for entry in self.entries)


class Recorder:
    """Records the calls and steps of one world."""

    def __init__(self, context: WorldContext, ticks: int, path: Path) -> None:
        """Start to record a built world.

        Args:
            context: context of the world.
            ticks: smallest number of ticks to keep.
            path: file to write when a body freezes.
        """
        self._ticks, self._path = ticks, path
        self._before: _Segment | None = None
        self._present = _Segment(take_snapshot(context))
        self._is_inside = False
        self._has_written = False
        self.field_accelerations: FieldAccelerations = []  # accelerations for the next step

    def call(
        self, method: Callable[..., Any], handle: Handle, arguments: tuple[Any, ...], options: dict[str, Any]
    ) -> Any:
        """Make a call and return its result. Record the call, unless it raises an error or another recorded
        call made it.
        """
        if self._is_inside:
            return method(handle, *arguments, **options)
        copied = [
            [_copied(each) for each in arguments],
            {name: _copied(each) for name, each in options.items()},
        ]
        self._is_inside = True
        try:
            found = method(handle, *arguments, **options)
        finally:
            self._is_inside = False
        self._present.entries.append(["call", serial_of(handle), method.__name__, *copied])
        return found

    def record_step(
        self, context: WorldContext, seconds: float, substeps: int, *, has_failure: bool
    ) -> list[str]:
        """Record a step and the hash of the state after it. Write the recording to its file if a body froze.

        Returns: lines to report to the user.
        """
        field_accelerations = [[serial, rows] for serial, rows in self.field_accelerations]
        self.field_accelerations = []
        self._present.entries.append(["step", seconds, substeps, state_hash(context), field_accelerations])
        self._present.steps += 1
        reports = [self._write(context)] if has_failure and not self._has_written else []
        if self._present.steps >= self._ticks:
            self._before, self._present = self._present, _Segment(take_snapshot(context))
        return reports

    def _write(self, context: WorldContext) -> str:
        self._has_written = True
        try:
            file = self.save(context, self._path)
        except SnapshotError as error:
            return f"no recording: {error}"
        return f"`taichi-soft replay {file}` replays the steps before it"

    def record_snapshot(self, snapshot: bytes) -> None:
        """Record that a snapshot was taken of the current state."""
        self._present.mark(snapshot)

    def rewind(self, context: WorldContext, snapshot: bytes) -> None:
        """Remove the entries that `World.restore` undid.

        Restart the recording if the snapshot was taken before the recording or in another world.
        """
        name = name_of_sealed(snapshot)
        self.field_accelerations = []
        if name in self._present.marks:
            self._present.rewind(name)
        elif self._before is not None and name in self._before.marks:
            self._before.rewind(name)
            self._present, self._before = self._before, None
        else:
            self._before, self._present = None, _Segment(take_snapshot(context))

    def content(self, context: WorldContext) -> bytes:
        """Return the recording up to the current state, as bytes."""
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
        if len(plain) > MAX_CONTENT:
            raise SnapshotError(
                f"the recording takes {len(plain) >> 20} MB, more than the limit of {MAX_CONTENT >> 20} MB: "
                "make the world with a smaller record"
            )
        return seal(MARK, VERSION, [zlib.compress(plain, 1), first.snapshot])

    def save(self, context: WorldContext, path: Any) -> Path:
        """See `World.save_recording`."""
        file = as_path(path)
        content = self.content(context)
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)
        except OSError as error:
            raise SnapshotError(f"cannot write {str(file)!r}: {error.strerror or error}") from None
        return file


def read_recording(path: Any) -> tuple[dict[str, Any], bytes]:
    """Read a file of a recording. Raises: SnapshotError.

    Returns: assets, options and entries of the recording; and the snapshot before the entries.
    """
    file = as_path(path)
    try:
        data = file.read_bytes()
    except OSError as error:
        raise SnapshotError(f"cannot read {str(file)!r}: {error.strerror or error}") from None
    if data[:1] == b"{":
        return _read_played(data)
    return _read_sealed(data)


def _read_played(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Read a file that a web page saved. Return content and snapshot as in `read_recording`.

    The file contains a recording, and the visitor's entries. The visitor's entries replace all entries of the
    recording from its first step on.
    """
    try:
        played = json.loads(data)
        made_of, snapshot = _read_sealed(base64.b64decode(played["start"], validate=True))
        before = takewhile(lambda entry: entry[0] == "call", made_of["entries"])
        return {**made_of, "entries": [*before, *played["entries"]]}, snapshot
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        if isinstance(error, TaichiSoftError):
            raise
        raise SnapshotError(
            f"this file was not saved by a page, or it is damaged ({error!r}): save it again there"
        ) from None


def _read_sealed(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Parse the result of `Recorder.content`. Return content and snapshot as in `read_recording`."""
    parts = unseal(data, MARK, VERSION, "recording")
    try:
        content, snapshot = parts
        inflating = zlib.decompressobj()
        plain = inflating.decompress(content, MAX_CONTENT)
        if not inflating.eof:
            raise SnapshotError(f"it is truncated, or takes more than {MAX_CONTENT >> 20} MB")
        made_of = from_json(plain)
    except (ValueError, zlib.error) as error:
        raise SnapshotError(f"this recording is invalid: {error}") from None
    return made_of, bytes(snapshot)


def _world_options(context: WorldContext) -> dict[str, Any]:
    """Return the arguments of `World` as plain data, because a snapshot does not contain them."""
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
    """Return the arguments of `SoftBodyAsset`, as plain data."""
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


def _copied(value: Any) -> Any:
    """Copy an argument, so that later changes by the caller do not affect it."""
    if isinstance(value, np.ndarray):
        return value.copy()
    if isinstance(value, (list, tuple)):
        return [_copied(each) for each in value]
    return value


def _plain(value: Any) -> Any:
    """Convert an argument to plain data: handles to serial numbers, assets and shapes to digests."""
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
