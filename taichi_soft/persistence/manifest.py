"""What Python knows of a world's state, as plain data and back: time, who lives where, what slices add."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.cut_mesh import CutMesh, name_of
from taichi_soft.bodies.description import BodyDescription
from taichi_soft.bodies.failure import FailedStep
from taichi_soft.bodies.layout import BodyArrays
from taichi_soft.bodies.soft_body import SoftBody, present_asset, record_of
from taichi_soft.core.checks import as_count, as_friction, as_gravity, as_number
from taichi_soft.core.errors import SnapshotError, TaichiSoftError
from taichi_soft.core.handles import serial_of
from taichi_soft.core.serialisation import as_plain, below, from_plain
from taichi_soft.elements.laws import fit_model
from taichi_soft.fracture.cutting import require_room
from taichi_soft.solver.context import WorldContext

_MOST = 1 << 53
"""No count of steps or handles, and no time [s], is larger."""


def write_manifest(context: WorldContext) -> dict[str, Any]:
    """What Python knows of a world's state, as plain data."""
    return {
        "steps": context.clock.steps,
        "time": context.clock.time,
        "last_dt": context.clock.last_dt,
        "gravity": context.settings.gravity.tolist(),
        "friction": context.settings.friction,
        "handles": context.handles.count,
        "bodies": [None if body is None else _body_entry(body) for body in context.slots.slots],
        "slices": {each.name: each.entries() for each in context.slices},
    }


def _body_entry(body: SoftBody) -> list[Any]:
    record = record_of(body)
    failed, part = record.frozen_in, record.part
    is_own = record.description is not present_asset(body).description
    return [
        serial_of(body),
        record.first_step,
        None if failed is None else [failed.step, failed.time, failed.substeps, failed.h, failed.is_braked],
        as_plain(record.description.material) if is_own else None,
        None if part is None else part.summary,
        record.level,
        None if record.held is None or record.level == 0 else record.held.tolist(),
        record.friction,
    ]


@dataclass
class BodyEntry:
    """Who is to live in a slot."""

    serial: int
    first_step: int
    failed: FailedStep | None
    part: CutMesh | None
    level: int  # of detail
    held: NDArray[np.int64] | None  # see `BodyRecord`
    friction: float | None  # where it is not its asset's
    description: BodyDescription
    arrays: BodyArrays | None  # of a part


@dataclass
class Manifest:
    """What was written, checked against a world in every respect."""

    steps: int
    time: float
    last_dt: float
    gravity: NDArray[np.float64]  # (3,) [m/s^2]
    friction: float  # of the floor
    handles: int
    bodies: list[BodyEntry | None]
    slices: dict[str, Any]  # what each has read


def read_parts(context: WorldContext, bodies: list[Any], rows: NDArray[np.int32]) -> dict[int, CutMesh]:
    """What cuts have left of bodies, by slot, from the entries of these and the rows of all parts one by one.

    Raises: as `read_manifest`.
    """
    parts: dict[int, CutMesh] = {}
    for slot, entry in enumerate(bodies):
        if entry is not None and entry[4] is not None:
            n, m = (below(count, len(rows) + 1) for count in entry[4][:2])
            size = 2 * n + 5 * m
            parts[slot] = CutMesh.of_rows(rows[:size], n, m)
            parts[slot].require_part_of(context.slots.assets[slot])
            if parts[slot].digest != entry[4][2]:
                raise ValueError(f"what was cut off body {slot} has another name")
            rows = rows[size:]
    if len(rows):
        raise ValueError(f"it has {len(rows)} words too many")
    return parts


def read_manifest(context: WorldContext, plain: dict[str, Any], parts: dict[int, CutMesh]) -> Manifest:
    """What `write_manifest` wrote.

    Raises: SnapshotError, or what Python raises where it is not in order.
    """
    if len(plain["bodies"]) != len(context.slots.slots):
        raise ValueError("it has another number of bodies")
    bodies = [_read_body(context, i, entry, parts.get(i)) for i, entry in enumerate(plain["bodies"])]
    vertex_counts = [0 if each is None else len(each.description.mesh.vertices) for each in bodies]
    _require_serials(context, plain)
    read: dict[str, Any] = {}
    for each in context.slices:
        read[each.name] = each.read(plain["slices"][each.name], vertex_counts, read)
    return Manifest(
        as_count(plain["steps"], "steps", 0, _MOST),
        as_number(plain["time"], "time", 0.0, _MOST),
        as_number(plain["last_dt"], "last_dt", 0.0, _MOST),
        as_gravity(plain["gravity"]),
        as_friction(plain["friction"]),
        as_count(plain["handles"], "handles", 1, _MOST),
        bodies,
        read,
    )


def _require_serials(context: WorldContext, plain: dict[str, Any]) -> None:
    """Raises: ValueError where two handles have the same number, or one that the next could have."""
    numbers = [entry[0] for entry in plain["bodies"] if entry is not None]
    for each in context.slices:
        numbers += each.serials(plain["slices"][each.name])
    serials = {as_count(number, "a handle", 1, _MOST) for number in numbers}
    if len(serials) < len(numbers) or max(serials, default=0) >= plain["handles"]:
        raise ValueError("two handles have the same number")


def _read_body(context: WorldContext, slot: int, entry: Any, part: CutMesh | None) -> BodyEntry | None:
    if entry is None:
        return None
    serial, first_step, failed, material, _, number, held, friction = entry
    levels, present = context.slots.assets[slot].levels, context.slots.slots[slot]
    level = below(number, len(levels))
    asset, whole = levels[level], levels[level].description
    if present is not None and (
        serial_of(present) != serial
        or name_of(record_of(present).part) != name_of(part)
        or record_of(present).level != level
    ):
        present = None
    own = None if present is None else record_of(present).description
    if own is whole:
        own = None
    description, arrays = whole, None
    if part is not None:
        description = own or part.describe(asset, whole.material)
    if material is not None:
        try:
            made = from_plain(material)
            fit_model(description.model, description.mesh, made)
        except TaichiSoftError as error:
            raise SnapshotError(
                f"this snapshot gives body {slot} a material that it cannot have: {error}"
            ) from None
        if type(made) is not type(description.material):
            raise ValueError(f"body {slot} is of another kind of material")
        is_same = own is not None and as_plain(made) == as_plain(own.material)
        description = own if own and is_same else replace(description, material=made)
    elif part is not None:
        raise ValueError(f"body {slot} was cut and has no material")
    if part is not None and present is None:
        arrays = part.arrange(asset, description)
        require_room(context, slot, arrays)
    return BodyEntry(
        int(serial),
        int(first_step),
        None
        if failed is None
        else FailedStep(int(failed[0]), float(failed[1]), int(failed[2]), float(failed[3]), bool(failed[4])),
        part,
        level,
        None if held is None else np.array([below(k, len(levels[0].mesh.vertices)) for k in held], np.int64),
        None if friction is None else as_friction(friction),
        description,
        arrays,
    )
