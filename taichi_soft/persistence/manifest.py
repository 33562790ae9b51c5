"""What Python knows of a world's state, as plain data and back: time, who lives where, colliders, joints."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.failure import FailedStep
from taichi_soft.bodies.layout import BodyArrays, BodyDescription
from taichi_soft.bodies.part import Part, name_of
from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.contact.colliders import Collider, ColliderRow
from taichi_soft.contact.shapes import Shape
from taichi_soft.control.frames import Frames
from taichi_soft.core.checks import as_count, as_flag, as_number
from taichi_soft.core.constants import ALL_GROUPS, POSITION_LIMIT
from taichi_soft.core.errors import SnapshotError, TaichiSoftError
from taichi_soft.core.serialisation import (
    as_plain,
    below,
    digest_of,
    from_plain,
    indices_below,
    plain_of,
    vector_of,
)
from taichi_soft.elements.laws import fit_model
from taichi_soft.fracture.cutting import require_room
from taichi_soft.solver.context import WorldContext

_MOST = 1 << 53
"""No count of steps or handles, and no time [s], is larger."""


def take_notes(context: WorldContext) -> dict[str, Any]:
    """What Python knows of a world's state, as plain data."""
    frames = context.of(Frames)
    return {
        "steps": context.clock.steps,
        "time": context.clock.time,
        "last_dt": context.clock.last_dt,
        "handles": context.handles.count,
        "bodies": [None if body is None else _body_note(context, body) for body in context.slots.slots],
        "colliders": [_collider_note(handle) for handle in context.colliders.all_handles],
        "shapes": {
            digest_of(row.shape): plain_of(row.shape)
            for row in (handle._row for handle in context.colliders.all_handles)
            if not len(row.shape.samples)
        },
        "frames": [None if frame is None else frame._serial for frame in frames.rows],
        "present": frames.present.tolist(),
        "coming": frames.coming.tolist(),
        "aims": frames.has_work,
        "slices": {each.name: each.note() for each in context.slices if each.name},
    }


def _body_note(context: WorldContext, body: SoftBody) -> list[Any]:
    failed, tears = body._frozen_in, context.built.tears
    is_own = body._description is not body.asset.description
    return [
        body._serial,
        body._first_step,
        None if failed is None else [failed.step, failed.time, failed.substeps, failed.h, failed.is_braked],
        _material_note(body._description) if is_own else None,
        [[a._serial, a.frame._number, a.two_way, a.particles.tolist()] for a in body._attachments],
        None if body._part is None else body._part.note,
        tears is not None and tears.rests(body),
    ]


def _material_note(description: BodyDescription) -> Any:
    return as_plain(description.material)


def _collider_note(handle: Collider) -> list[Any]:
    row = handle._row
    target = None if row.target is None else [each.tolist() for each in row.target]
    motion = [each.tolist() for each in (row.position, row.rotation, row.velocity, row.spin)]
    surface = [row.friction, row.restitution, row.thickness, row.group, row.mask]
    return [handle._serial, row.is_alive, digest_of(row.shape), row.offset, surface, motion, target]


@dataclass
class BodyNote:
    """Who is to live in a slot."""

    serial: int
    first_step: int
    failed: FailedStep | None
    part: Part | None
    description: BodyDescription
    arrays: BodyArrays | None  # of a part
    attachments: list[tuple[int, int, bool, NDArray[np.int32]]]
    rests: bool  # tears no more


@dataclass
class Notes:
    """Notes that were checked against a world in every respect."""

    steps: int
    time: float
    last_dt: float
    handles: int
    bodies: list[BodyNote | None]
    colliders: list[tuple[int, ColliderRow]]
    frames: list[int | None]  # None for a free row
    present: NDArray[np.float32]
    coming: NDArray[np.float32]
    aims: bool
    slices: dict[str, Any]  # what each has read


def read_parts(context: WorldContext, notes: list[Any], rows: NDArray[np.int32]) -> dict[int, Part]:
    """What cuts have left of bodies, by slot, from the notes of these and the rows of all parts one by one.

    Raises: as `read_notes`.
    """
    parts: dict[int, Part] = {}
    for slot, note in enumerate(notes):
        if note is not None and note[5] is not None:
            n, m = (below(count, len(rows) + 1) for count in note[5][:2])
            size = 2 * n + 5 * m
            parts[slot] = Part.of_rows(rows[:size], n, m)
            parts[slot].require_of(context.slots.assets[slot])
            if parts[slot].digest != note[5][2]:
                raise ValueError(f"what was cut off body {slot} has another name")
            rows = rows[size:]
    if len(rows):
        raise ValueError(f"it has {len(rows)} words too many")
    return parts


def read_notes(context: WorldContext, notes: dict[str, Any], parts: dict[int, Part]) -> Notes:
    """Notes of `take_notes`. Raises: SnapshotError, or what Python raises where they are not in order."""
    frames = [None if serial is None else int(serial) for serial in notes["frames"]]
    poses = {
        name: np.array(notes[name], dtype=np.float64).reshape(max(len(frames), 1), 12)
        for name in ("present", "coming")
    }
    if not all((np.abs(rows) <= POSITION_LIMIT).all() for rows in poses.values()):
        raise ValueError("a frame is out of reach")
    slots = len(context.slots.slots)
    if len(notes["bodies"]) != slots:
        raise ValueError("it has another number of bodies")
    bodies = [_read_body(context, i, note, frames, parts.get(i)) for i, note in enumerate(notes["bodies"])]
    vertex_counts = [0 if each is None else len(each.description.mesh.vertices) for each in bodies]
    named = [each for each in context.slices if each.name]
    _require_serials(notes)
    return Notes(
        as_count(notes["steps"], "steps", 0, _MOST),
        as_number(notes["time"], "time", 0.0, _MOST),
        as_number(notes["last_dt"], "last_dt", 0.0, _MOST),
        as_count(notes["handles"], "handles", 1, _MOST),
        bodies,
        [_read_collider(context, note, notes["shapes"]) for note in _some(notes["colliders"], context)],
        frames,
        poses["present"].astype(np.float32),
        poses["coming"].astype(np.float32),
        bool(notes["aims"]),
        {each.name: each.read(notes["slices"][each.name], vertex_counts) for each in named},
    )


def _require_serials(notes: dict[str, Any]) -> None:
    """Raises: ValueError where two handles have the same number, or one that the next could have."""
    bodies = [note for note in notes["bodies"] if note is not None]
    hanging = [each for note in bodies for each in note[4]]
    sliced = [each for rows in notes["slices"].values() for each in rows]
    held = [*bodies, *hanging, *notes["colliders"], *sliced]
    numbers = [each[0] for each in held] + [number for number in notes["frames"] if number is not None]
    serials = {as_count(number, "a handle", 1, _MOST) for number in numbers}
    if len(serials) < len(numbers) or max(serials, default=0) >= notes["handles"]:
        raise ValueError("two handles have the same number")


def _some(notes: list[Any], context: WorldContext) -> list[Any]:
    if len(notes) > context.built.state.capacity.contact.colliders:
        raise ValueError(f"it has {len(notes)} colliders, and there is no room for them")
    return notes


def _read_body(
    context: WorldContext, slot: int, note: Any, frames: list[int | None], part: Part | None
) -> BodyNote | None:
    if note is None:
        return None
    serial, first_step, failed, material, attachments, _, rests = note
    asset = context.slots.assets[slot]
    whole, present = asset.description, context.slots.slots[slot]
    if present is not None and (present._serial != serial or name_of(present._part) != name_of(part)):
        present = None
    own = None if present is None or present._description is whole else present._description
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
    n = len(description.mesh.vertices)
    return BodyNote(
        int(serial),
        int(first_step),
        None
        if failed is None
        else FailedStep(int(failed[0]), float(failed[1]), int(failed[2]), float(failed[3]), bool(failed[4])),
        part,
        description,
        arrays,
        [
            (int(each), _row_of_frame(frame, frames), bool(two_way), indices_below(particles, n))
            for each, frame, two_way, particles in attachments
        ],
        bool(rests),
    )


def _read_collider(context: WorldContext, note: Any, shapes: dict[str, Any]) -> tuple[int, ColliderRow]:
    serial, is_alive, digest, offset, surface, motion, target = note
    shape = context.colliders.shapes.get(digest)
    if shape is None:
        shape = from_plain(shapes.get(digest))
    if not isinstance(shape, Shape):
        raise SnapshotError(
            "this snapshot has a collider with a grid that this world never had: add one of each MeshShape "
            "and HeightFieldShape (and remove it again) before restoring"
        )
    friction, restitution, thickness, group, mask = surface
    position, rotation, velocity, spin = (
        vector_of(each, n) for each, n in zip(motion, (3, 4, 3, 3), strict=True)
    )
    if abs(np.linalg.norm(rotation) - 1.0) > 1e-3:
        raise ValueError("a rotation is none")
    row = ColliderRow(
        shape,
        as_number(friction, "friction", 0.0, 1e6),
        -1.0 if restitution == -1.0 else as_number(restitution, "restitution", 0.0, 1.0),
        as_number(thickness, "thickness", 0.0, 1e3),
        as_count(group, "group", 0, ALL_GROUPS),
        as_count(mask, "mask", 0, ALL_GROUPS),
        position,
        rotation,
        velocity,
        spin,
        as_count(offset, "offset", 0),
        None if target is None else (vector_of(target[0], 3), vector_of(target[1], 4)),
        as_flag(is_alive, "is_alive"),
    )
    if not row.offset <= context.built.state.capacity.contact.samples - len(shape.samples):
        raise ValueError("a collider's grid lies outside the room for grids")
    return int(serial), row


def _row_of_frame(number: Any, frames: list[int | None]) -> int:
    if frames[below(number, len(frames))] is None:
        raise ValueError("an attachment hangs from no frame")
    return int(number)
