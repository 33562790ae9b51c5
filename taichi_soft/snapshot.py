"""The state of a world between two steps, as bytes and back.

A snapshot has three parts. The *structure* is what the world was built of; a world of another structure
refuses it. The *notes* are what Python knows: time, who lives in which slot, colliders, frames, grabs. The
*words* are what the fields hold, bit by bit (see `kernels.snapshot`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from hashlib import blake2b
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.body import Body
from taichi_soft.colliders import Collider, ColliderRow
from taichi_soft.constants import POSITION_LIMIT, VELOCITY_LIMIT
from taichi_soft.control.attachments import Attachment
from taichi_soft.control.frames import Frame
from taichi_soft.control.grabs import Grab
from taichi_soft.control.materials import write_constants
from taichi_soft.cutting import refill_slot
from taichi_soft.errors import SnapshotError, StateError, TaichiSoftError
from taichi_soft.failures import FailedStep
from taichi_soft.kernels.pins import WITH_FRAME
from taichi_soft.kernels.snapshot import (
    BODY,
    GRAB,
    HELD,
    PARTICLE,
    PATCH,
    carried,
    hash_bodies,
    pack_state,
    row_table,
    unpack_state,
)
from taichi_soft.laws import fit_model
from taichi_soft.plain import as_plain, digest_of, from_json, from_plain, plain_of, to_json
from taichi_soft.scene import BodyDescription
from taichi_soft.sealed import seal, unseal
from taichi_soft.shapes import Shape
from taichi_soft.state import ABSENT, MOST_GRABS, PATCH_ROWS, State

if TYPE_CHECKING:
    from taichi_soft.assets import SoftBodyAsset
    from taichi_soft.world import World

MARK, VERSION = b"TSOFTSNP", 1

Words = NDArray[np.int32]


def take_snapshot(world: World) -> bytes:
    """As `World.snapshot`."""
    state = world._built.state
    cut = next((body for body in world.bodies if body.is_cut), None)
    if cut is not None:
        raise StateError(f"body {cut.index} was cut: a snapshot holds no bodies that were cut or torn")
    table = _table(world, max(world._grabs, default=-1) + 1)
    words = np.empty(int(table[-1, 2]), dtype=np.int32)
    pack_state(state, table, words)
    return seal(MARK, VERSION, [world._structure, to_json(take_notes(world)), words.astype("<i4").tobytes()])


def state_hash(world: World) -> str:
    """As `World.state_hash`."""
    code = int(hash_bodies(world._built.state, world.slot_count))
    return blake2b(to_json([code, take_notes(world)]), digest_size=8).hexdigest()


def _table(world: World, held: int) -> Words:
    scene = world._scene
    return row_table(world._built.state, scene.particle_count, world.slot_count, scene.block_count, held)


def structure_of(world: World) -> bytes:
    """What a snapshot's world must be built of, as JSON."""
    settings = {name: as_plain(value) for name, value in asdict(world.settings).items()}
    return to_json(
        {
            "package": _package_version(),
            "capacity": asdict(world._built.state.capacity),
            "soft_contact": world._contact.soft,
            "sleep_speed": world._contact.sleep_speed,
            **settings,
            "bodies": [asset_digest(asset) for asset in world._pools.assets],
        }
    )


def _package_version() -> str:
    try:
        return version("taichi-soft")
    except PackageNotFoundError:
        return "not installed"


def asset_digest(asset: SoftBodyAsset) -> str:
    """A name of what an asset is made of."""
    described = asset.description
    model = described.model
    parts = [model.law.name, model.strain, model.flips, model.damping_model]
    touch = asset.contact
    thickness = None if touch.thickness is None else float(touch.thickness)
    contact: list[Any] = [float(touch.friction), thickness, touch.itself, touch.group, touch.mask]
    flow = None if asset.plasticity is None else [float(each) for each in asset.plasticity.row]
    tear = None if asset.tearing is None else [float(asset.tearing.stress), asset.tearing.most]
    contact += [flow, asset.spare_vertices, tear]
    content = [digest_of(described.mesh), digest_of(described.material), described.pinned.tolist()]
    return blake2b(to_json([as_plain(parts), content, contact]), digest_size=8).hexdigest()


def take_notes(world: World) -> dict[str, Any]:
    """What Python knows of a world's state, as plain data."""
    frames = world._frames
    return {
        "steps": world._clock.steps,
        "time": world._clock.time,
        "last_dt": world._clock.last_dt,
        "handles": world._handles.count,
        "bodies": [None if body is None else _body_note(body) for body in world._pools.slots],
        "colliders": [_collider_note(handle) for handle in world._colliders.all_handles],
        "shapes": {
            digest_of(row.shape): plain_of(row.shape)
            for row in (handle._row for handle in world._colliders.all_handles)
            if not len(row.shape.samples)
        },
        "samples": world._colliders.sample_count,
        "frames": [frame._serial for frame in frames.handles],
        "present": frames.present.tolist(),
        "coming": frames.coming.tolist(),
        "aims": frames.has_work,
        "grabs": [
            [grab._serial, number, grab.body.index, grab.point.tolist()]
            for number, grab in sorted(world._grabs.items())
        ],
    }


def _body_note(body: Body) -> list[Any]:
    failed = body._frozen_in
    is_own = body._description is not body.asset.description
    return [
        body._serial,
        body._first_step,
        None if failed is None else [failed.step, failed.time, failed.substeps, failed.h],
        _material_note(body._description) if is_own else None,
        [[a._serial, a.frame._number, a.two_way, a.particles.tolist()] for a in body._attachments],
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
class _BodyPlan:
    """Who is to live in a slot."""

    serial: int
    first_step: int
    failed: FailedStep | None
    description: BodyDescription
    attachments: list[tuple[int, int, bool, NDArray[np.int32]]]


@dataclass
class _Plan:
    """A snapshot that was checked against a world in every respect."""

    steps: int
    time: float
    last_dt: float
    handles: int
    bodies: list[_BodyPlan | None]
    colliders: list[tuple[int, ColliderRow]]
    samples: int
    frames: list[int]
    present: NDArray[np.float32]
    coming: NDArray[np.float32]
    aims: bool
    grabs: list[tuple[int, int, int, NDArray[np.float64]]]
    table: Words
    words: Words


def restore_snapshot(world: World, data: Any) -> None:
    """As `World.restore`."""
    state = world._built.state
    structure, notes, words = _three(unseal(data, MARK, VERSION, "snapshot"))
    _require_structure(bytes(structure), world._structure)
    content = from_json(notes)
    try:
        plan = _read_plan(world, content, np.frombuffer(words, "<i4").astype(np.int32))
    except (KeyError, TypeError, ValueError, IndexError, OverflowError, AttributeError) as error:
        if isinstance(error, SnapshotError):
            raise
        raise SnapshotError(f"this snapshot is not in order: {error}") from None
    _require_words(world, plan)
    _apply(world, state, plan)


def _three(parts: list[memoryview]) -> list[memoryview]:
    if len(parts) != 3:
        raise SnapshotError(f"this snapshot has {len(parts)} parts instead of 3")
    return parts


def _require_structure(theirs: bytes, ours: bytes) -> None:
    """Raises: SnapshotError with the first thing that differs."""
    if theirs == ours:
        return
    made_of, mine = from_json(theirs), from_json(ours)
    if not isinstance(made_of, dict):
        raise SnapshotError("this snapshot does not say what its world was built of")
    for name, value in mine.items():
        other = made_of.get(name)
        if other == value:
            continue
        if name == "bodies" and isinstance(other, list) and len(other) == len(value):
            slot = next(i for i, (a, b) in enumerate(zip(other, value, strict=True)) if a != b)
            raise SnapshotError(
                f"this snapshot is of another world: the asset of body {slot} has another mesh, material, "
                "law or options"
            )
        if name == "bodies" and isinstance(other, list):
            value, other = len(value), len(other)
        raise SnapshotError(
            f"this snapshot is of another world: its {name} is {str(other)[:200]}, here it is "
            f"{str(value)[:200]}"
        )
    raise SnapshotError("this snapshot is of another world")


def _read_plan(world: World, notes: dict[str, Any], words: Words) -> _Plan:
    count = len(notes["frames"])
    poses = {
        name: np.array(notes[name], dtype=np.float32).reshape(max(count, 1), 12)
        for name in ("present", "coming")
    }
    slots = world.slot_count
    if len(notes["bodies"]) != slots:
        raise ValueError("it has another number of bodies")
    bodies = [_read_body(world, i, note, count) for i, note in enumerate(notes["bodies"])]
    grabs = [
        (int(serial), _below(number, MOST_GRABS), _below(slot, slots), _vector(point, 3))
        for serial, number, slot, point in notes["grabs"]
    ]
    if any(bodies[slot] is None for _, _, slot, _ in grabs):
        raise ValueError("a grab holds no body")
    held = max((number for _, number, _, _ in grabs), default=-1) + 1
    table = _table(world, held)
    if len(words) != table[-1, 2]:
        raise ValueError(f"it has {len(words)} words, where this world takes {table[-1, 2]}")
    return _Plan(
        int(notes["steps"]),
        float(notes["time"]),
        float(notes["last_dt"]),
        int(notes["handles"]),
        bodies,
        [_read_collider(world, note, notes["shapes"]) for note in _some(notes["colliders"], world)],
        int(notes["samples"]),
        [int(serial) for serial in notes["frames"]],
        poses["present"],
        poses["coming"],
        bool(notes["aims"]),
        grabs,
        table,
        words,
    )


def _some(notes: list[Any], world: World) -> list[Any]:
    if len(notes) > world._built.state.capacity.contact.colliders:
        raise ValueError(f"it has {len(notes)} colliders, and there is no room for them")
    return notes


def _read_body(world: World, slot: int, note: Any, frame_count: int) -> _BodyPlan | None:
    if note is None:
        return None
    serial, first_step, failed, material, attachments = note
    asset = world._pools.assets[slot]
    description = asset.description
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
        description = replace(description, material=made)
    n = len(asset.mesh.vertices)
    return _BodyPlan(
        int(serial),
        int(first_step),
        None
        if failed is None
        else FailedStep(int(failed[0]), float(failed[1]), int(failed[2]), float(failed[3])),
        description,
        [
            (int(each), _below(frame, frame_count), bool(two_way), _indices(particles, n))
            for each, frame, two_way, particles in attachments
        ],
    )


def _read_collider(world: World, note: Any, shapes: dict[str, Any]) -> tuple[int, ColliderRow]:
    serial, is_alive, digest, offset, surface, motion, target = note
    shape = world._colliders.shapes.get(digest)
    if shape is None:
        shape = from_plain(shapes.get(digest))
    if not isinstance(shape, Shape):
        raise SnapshotError(
            "this snapshot has a collider with a grid that this world never had: add one of each MeshShape "
            "and HeightFieldShape (and remove it again) before restoring"
        )
    friction, restitution, thickness, group, mask = surface
    position, rotation, velocity, spin = (
        _vector(each, n) for each, n in zip(motion, (3, 4, 3, 3), strict=True)
    )
    row = ColliderRow(
        shape,
        float(friction),
        float(restitution),
        float(thickness),
        int(group),
        int(mask),
        position,
        rotation,
        velocity,
        spin,
        int(offset),
        None if target is None else (_vector(target[0], 3), _vector(target[1], 4)),
        bool(is_alive),
    )
    if not 0 <= row.offset <= world._built.state.capacity.contact.samples - len(shape.samples):
        raise ValueError("a collider's grid lies outside the room for grids")
    return int(serial), row


def _below(number: Any, limit: int) -> int:
    if not 0 <= int(number) < limit:
        raise ValueError(f"it names number {number} of {limit}")
    return int(number)


def _vector(numbers: Any, count: int) -> NDArray[np.float64]:
    vector = np.array(numbers, dtype=np.float64)
    if vector.shape != (count,) or not np.isfinite(vector).all():
        raise ValueError("a vector is none")
    return vector


def _indices(numbers: Any, limit: int) -> NDArray[np.int32]:
    found = np.array(numbers, dtype=np.int32)
    if found.ndim != 1 or len(found) == 0 or found.min() < 0 or found.max() >= limit:
        raise ValueError("an attachment names vertices that there are not")
    return found


def _require_words(world: World, plan: _Plan) -> None:
    """Raises: SnapshotError where a kernel would read beyond its fields, or begin with what is not finite."""
    state = world._built.state
    particles, slots = world._scene.particle_count, world.slot_count
    limits: list[tuple[int, Any, int]] = [
        (PARTICLE, state.particle_aim, WITH_FRAME + len(plan.frames)),
        (BODY, state.body_status, ABSENT + 1),
        (GRAB, state.grab_body, slots + 1),
        (HELD, state.grab_corners, particles),
        (HELD, state.grab_count, PATCH_ROWS + 1),
        (PATCH, state.patch_particle, particles),
    ]
    for owner, field, limit in limits:
        rows = _rows(plan, state, owner, field)
        if rows.size and not (rows.min() >= 0 and rows.max() < limit):
            raise SnapshotError(
                "this snapshot is not in order: it names particles or bodies that there are not"
            )
    for field, highest in (
        (state.particle_position, POSITION_LIMIT),
        (state.particle_velocity, VELOCITY_LIMIT),
    ):
        values = _rows(plan, state, PARTICLE, field).view(np.float32)
        if not np.abs(values).max() <= highest:
            raise SnapshotError("this snapshot is not in order: particles are out of reach, or not finite")
    lives = _rows(plan, state, BODY, state.body_status)[:, 0] != ABSENT
    if lives.tolist() != [body is not None for body in plan.bodies]:
        raise SnapshotError("this snapshot is not in order: it is not sure who lives")


def _rows(plan: _Plan, state: State, owner: int, wanted: Any) -> Words:
    """What a snapshot holds for a field, (rows, width)."""
    count, width, begin = plan.table[owner].tolist()
    rows = plan.words[begin : begin + count * width].reshape(count, width)
    for field, column, size in carried(state, owner):
        if field is wanted:
            return np.ascontiguousarray(rows[:, column : column + size])
    raise KeyError(owner)


def _apply(world: World, state: State, plan: _Plan) -> None:
    """Nothing here can be refused any more."""
    simulation, clock = world._built, world._clock
    clock.steps, clock.time, clock.last_dt = plan.steps, plan.time, plan.last_dt
    handles = world._handles
    _apply_frames(world, plan)
    colliders = world._colliders
    colliders.restore(
        [row for _, row in plan.colliders],
        plan.samples,
        lambda i, row: _handle(world, plan.colliders[i][0], Collider, lambda: Collider(colliders, i, row)),
    )
    for slot, wanted in enumerate(plan.bodies):
        _apply_body(world, state, slot, wanted)
    world._grabs.clear()
    for serial, number, slot, point in plan.grabs:
        body = world._pools.slots[slot]
        assert body is not None
        grab = _handle(world, serial, Grab, lambda b=body, n=number, x=point: Grab(b, n, x))  # type: ignore[misc]
        grab.body, grab._number, grab._point = body, number, point
        world._grabs[number] = grab
    handles.count = plan.handles
    if simulation.tears is not None:
        for body in world.bodies:
            simulation.tears.watch(body)
    unpack_state(state, plan.table, plan.words)
    simulation.readout.has_moved()
    world._substeps.forget()


def _handle(world: World, serial: int, kind: type[Any], make: Callable[[], Any]) -> Any:
    """The handle of that number: the one that the caller has, or a new one."""
    found = world._handles.find(serial, kind)
    if found is None:
        found = make()
        world._handles.enlist(found, serial)
    return found


def _apply_frames(world: World, plan: _Plan) -> None:
    frames = world._frames
    frames.present, frames.coming, frames.has_work = plan.present, plan.coming, plan.aims
    frames.handles.clear()
    frames.count = len(plan.frames)
    for number, serial in enumerate(plan.frames):
        frame = world._handles.find(serial, Frame) or Frame.at(frames, number)
        if frame._number != number:
            frame = Frame.at(frames, number)
        world._handles.enlist(frame, serial)
        frames.handles.append(frame)


def _apply_body(world: World, state: State, slot: int, wanted: _BodyPlan | None) -> None:
    """Put the right body into a slot, of the right material."""
    present, asset = world._pools.slots[slot], world._pools.assets[slot]
    if present is not None and (wanted is None or present._serial != wanted.serial):
        if present._description is not asset.description and not present.is_cut:
            write_constants(state, present, asset.description)
            present._description = asset.description
        present._attachments.clear()
        world._pools.leave(present)
        present._removed_in = world.step_count
        present = None
    if wanted is None:
        return
    if present is not None and present.is_cut:
        refill_slot(world, state, slot)
        present._become_whole()
    if present is None:
        if world._scene.bodies[slot] is not asset.arrays:
            refill_slot(world, state, slot)
        known = world._handles.find(wanted.serial, Body)
        if known is not None and known.index == slot and known.asset is asset:
            present = known
        else:
            present = Body(world, slot, asset)
            world._handles.enlist(present, wanted.serial)
        present._removed_in = None
        if present.is_cut:
            present._become_whole()
        present._description = asset.description
        world._pools.enter_at(present)
    present._first_step = wanted.first_step
    present._frozen_in, present._failure = wanted.failed, None
    if as_plain(present._description.material) != as_plain(wanted.description.material):
        write_constants(state, present, wanted.description)
    present._description = wanted.description
    present._attachments.clear()
    for serial, number, two_way, particles in wanted.attachments:
        frame = world._frames.handles[number]
        held = world._handles.find(serial, Attachment) or Attachment(
            present, particles, frame, two_way=two_way
        )
        held.body, held.frame, held.particles, held.two_way = present, frame, particles, two_way
        world._handles.enlist(held, serial)
        present._attachments.append(held)
