"""Manifest: the state of a world outside its fields, as plain data. A manifest contains time, bodies and
slices.
"""

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
from taichi_soft.core.constants import POSITION_LIMIT
from taichi_soft.core.errors import SnapshotError, TaichiSoftError
from taichi_soft.core.handles import serial_of
from taichi_soft.core.serialisation import as_plain, below, from_plain
from taichi_soft.elements.laws import fit_model
from taichi_soft.fracture.cutting import require_room
from taichi_soft.solver.context import WorldContext

_MAX_COUNT = 1 << 53
"""Largest valid number of steps and of handles. It is also the largest valid time [s]."""


def write_manifest(context: WorldContext) -> dict[str, Any]:
    """Return the manifest of a world: its state outside the fields, as plain data."""
    floor = context.settings.floor
    return {
        **({} if floor == context.first_floor else {"floor": floor}),  # after `World.shift_origin`
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
    has_own_material = record.description is not present_asset(body).description
    return [
        serial_of(body),
        record.first_step,
        None if failed is None else [failed.step, failed.time, failed.substeps, failed.h, failed.is_braked],
        as_plain(record.description.material) if has_own_material else None,
        None if part is None else part.summary,
        record.level,
        None if record.held is None or record.level == 0 else record.held.tolist(),
        record.friction,
    ]


@dataclass
class BodyEntry:
    """Entry of a manifest for a body that will occupy a slot."""

    serial: int
    first_step: int
    failed: FailedStep | None
    part: CutMesh | None
    level: int  # level of detail
    held: NDArray[np.int64] | None  # see `BodyRecord`
    friction: float | None  # friction of the body; None for the asset's friction
    description: BodyDescription
    arrays: BodyArrays | None  # arrays of a cut body; None for an uncut body


@dataclass
class Manifest:
    """Contents of a manifest, after all checks against the world."""

    steps: int
    time: float
    last_dt: float
    gravity: NDArray[np.float64]  # (3,) [m/s^2]
    friction: float  # friction of the floor
    floor: float | None  # height of the floor [m]
    handles: int
    bodies: list[BodyEntry | None]
    slices: dict[str, Any]  # result of `Slice.read` by name of the slice


def read_parts(context: WorldContext, bodies: list[Any], rows: NDArray[np.int32]) -> dict[int, CutMesh]:
    """Read the meshes of cut bodies. Returns: meshes by slot.

    Args:
        bodies: entries of bodies in the manifest.
        rows: words of all cut meshes, concatenated.
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
                raise ValueError(f"the cut mesh of body {slot} has another digest")
            rows = rows[size:]
    if len(rows):
        raise ValueError(f"it has {len(rows)} words too many")
    return parts


def read_manifest(context: WorldContext, plain: dict[str, Any], parts: dict[int, CutMesh]) -> Manifest:
    """Read a manifest from the data of `write_manifest`, and check it against a world.

    Raises: SnapshotError, or a built-in exception such as KeyError, if the data are invalid.
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
        as_count(plain["steps"], "steps", 0, _MAX_COUNT),
        as_number(plain["time"], "time", 0.0, _MAX_COUNT),
        as_number(plain["last_dt"], "last_dt", 0.0, _MAX_COUNT),
        as_gravity(plain["gravity"]),
        as_friction(plain["friction"]),
        _floor_of(context, plain),
        as_count(plain["handles"], "handles", 1, _MAX_COUNT),
        bodies,
        read,
    )


def _floor_of(context: WorldContext, plain: dict[str, Any]) -> float | None:
    """Return the height of the floor [m]. Raises: OptionError or ValueError for an invalid height."""
    floor = plain.get("floor", context.first_floor)
    if floor is None or context.first_floor is None:
        if floor is not context.first_floor:
            raise ValueError("only one of the two worlds has a floor")
        return None
    return as_number(floor, "floor", -POSITION_LIMIT, POSITION_LIMIT)


def _require_serials(context: WorldContext, plain: dict[str, Any]) -> None:
    """Check the serial numbers of handles. Raises: ValueError for duplicates or numbers out of range."""
    numbers = [entry[0] for entry in plain["bodies"] if entry is not None]
    for each in context.slices:
        numbers += each.serials(plain["slices"][each.name])
    serials = {as_count(number, "a handle", 1, _MAX_COUNT) for number in numbers}
    if len(serials) < len(numbers) or max(serials, default=0) >= plain["handles"]:
        raise ValueError("the serial numbers of its handles are not unique")


def _read_body(context: WorldContext, slot: int, entry: Any, part: CutMesh | None) -> BodyEntry | None:
    if entry is None:
        return None
    serial, first_step, failed, material, _, number, held, friction = entry
    levels, present = context.slots.assets[slot].levels, context.slots.slots[slot]
    level = below(number, len(levels))
    asset, base = levels[level], levels[level].description
    if present is not None and (
        serial_of(present) != serial
        or name_of(record_of(present).part) != name_of(part)
        or record_of(present).level != level
    ):
        present = None
    current = None if present is None else record_of(present).description
    if current is base:
        current = None
    description, arrays = base, None
    if part is not None:
        description = current or part.describe(asset, base.material)
    if material is not None:
        try:
            own_material = from_plain(material)
            fit_model(description.model, description.mesh, own_material)
        except TaichiSoftError as error:
            raise SnapshotError(f"this snapshot gives body {slot} an invalid material: {error}") from None
        if type(own_material) is not type(description.material):
            raise ValueError(f"body {slot} has a material of another type")
        is_same = current is not None and as_plain(own_material) == as_plain(current.material)
        description = current if current and is_same else replace(description, material=own_material)
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
