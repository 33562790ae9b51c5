"""The state of a world between two steps, as bytes and back.

A snapshot has four parts. The *structure* is what the world was built of; a world of another structure
refuses it. The *manifest* is what Python knows: time, gravity, who lives in which slot, and what each
slice enters (colliders, frames, joints ...). The *words* are what the fields hold, bit by bit (see
`persistence.kernels.packing`), and what cuts have left of meshes (see `bodies.cut_mesh`). The last part is
what events go on with (see `events.event_state`).
"""

from __future__ import annotations

from functools import partial
from hashlib import blake2b
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.soft_body import SoftBody, record_of
from taichi_soft.bodies.status import ABSENT
from taichi_soft.contact.collider import Collider
from taichi_soft.core.constants import POSITION_LIMIT, VELOCITY_LIMIT
from taichi_soft.core.container import seal, unseal
from taichi_soft.core.errors import SnapshotError, StateError
from taichi_soft.core.runtime import ti
from taichi_soft.core.serialisation import from_json, to_json
from taichi_soft.events import Known, Memory
from taichi_soft.persistence.kernels.packing import (
    BODY,
    PARTICLE,
    SHAPE,
    WORLD,
    carried,
    copy_state,
    hash_bodies,
    owners,
    row_table,
)
from taichi_soft.persistence.manifest import Manifest, read_manifest, read_parts, write_manifest
from taichi_soft.persistence.restoring import put_back
from taichi_soft.persistence.world_structure import require_structure, structure_of
from taichi_soft.solver.context import WorldContext
from taichi_soft.solver.state import State

MARK, VERSION = b"TSOFTSNP", 12

Words = NDArray[np.int32]


def take_snapshot(context: WorldContext) -> bytes:
    """As `World.snapshot`."""
    state = context.built.state
    manifest = write_manifest(context)
    table = _table(context, manifest["slices"])
    words = np.empty(int(table[-1, 2]), dtype=np.int32)
    copy_state(state, table, words, True)
    parts = [record_of(body).part for body in context.slots.occupants]
    words = np.concatenate([words, *(part.rows for part in parts if part is not None)])
    memory = to_json(context.built.events.remember().plain)
    content = [to_json(manifest), words.astype("<i4").tobytes(), memory]
    return seal(MARK, VERSION, [_structure(context), *content])


def _structure(context: WorldContext) -> bytes:
    """What a snapshot's world must be built of: as `structure_of`, worked out once."""
    if not context.structure:
        context.structure = structure_of(context)
    return context.structure


def state_hash(context: WorldContext) -> str:
    """As `World.state_hash`."""
    code = int(hash_bodies(context.built.state, len(context.slots.slots)))
    return blake2b(to_json([code, write_manifest(context)]), digest_size=8).hexdigest()


def bodies_hash(context: WorldContext) -> str:
    """As `World.bodies_hash`."""
    code = int(hash_bodies(context.built.state, len(context.slots.slots)))
    return f"{code % 2**64:016x}"


def _table(context: WorldContext, entries: dict[str, list[list[Any]]]) -> Words:
    """Where the words of each group of fields are, by what slices have entered in a manifest."""
    state, scene, slots = context.built.state, context.layout, len(context.slots.slots)
    of_slices = {each.name: each for each in context.slices}
    counts = [count for name in state.carried for count in of_slices[name].row_counts(entries[name])]
    return row_table(state, scene.particle_count, slots, scene.block_count, counts)


def carried_rows(context: WorldContext) -> list[int]:
    """How many rows of each group of fields a snapshot has: of its `owners`, in their order."""
    rows: list[int] = _table(context, write_manifest(context)["slices"])[:-1, 0].tolist()
    return rows


def restore_snapshot(context: WorldContext, data: Any, *, keeps_events: bool = False) -> None:
    """As `World.restore`.

    Args: keeps_events: no step was made since, so the events that wait are not undone.
    """
    state = context.built.state
    structure, content, rows, remembered = _four(unseal(data, MARK, VERSION, "snapshot"))
    require_structure(bytes(structure), _structure(context))
    plain = from_json(content)
    try:
        words = np.frombuffer(rows, "<i4").astype(np.int32)
        table = _table(context, plain["slices"])
        if len(words) < table[-1, 2]:
            raise ValueError(f"it has {len(words)} words, where this world takes {table[-1, 2]}")
        parts = read_parts(context, plain["bodies"], words[table[-1, 2] :])
        words = words[: table[-1, 2]]
        manifest = read_manifest(context, plain, parts)
        memory = Memory.of(from_json(remembered), len(context.slots.slots))
    except (KeyError, TypeError, ValueError, IndexError, OverflowError, AttributeError, StateError) as error:
        if isinstance(error, SnapshotError):
            raise
        raise SnapshotError(f"this snapshot is not in order: {error}") from None
    _require_words(context, manifest, table, words)
    put_back(context, manifest)
    for each in context.slices:
        each.clear()
    copy_state(state, table, words, False)
    for each in context.slices:
        each.restore(manifest.slices[each.name])
    context.handles.count = manifest.handles
    find = context.handles.find
    known = Known(lambda serial: find(serial, SoftBody), lambda serial: find(serial, Collider))
    if not keeps_events:
        context.built.events.forget_since(manifest.steps)
    context.built.events.recall(memory, manifest.steps, known)


def _four(parts: list[memoryview]) -> list[memoryview]:
    if len(parts) != 4:
        raise SnapshotError(f"this snapshot has {len(parts)} parts instead of 4")
    return parts


def _require_words(context: WorldContext, manifest: Manifest, table: Words, words: Words) -> None:
    """Raises: SnapshotError where a kernel would read beyond its fields, or begin with what is not finite."""
    state = context.built.state
    limits: list[tuple[int, Any, int]] = [
        (BODY, state.body_status, ABSENT + 1),
    ]
    if state.capacity.implicit:
        limits.append((PARTICLE, state.particle_contact, max(state.capacity.contact.colliders, 1) + 1))
    for owner, field, limit in limits:
        rows = _rows(table, words, state, owner, field)
        if rows.size and not (rows.min() >= 0 and rows.max() < limit):
            raise SnapshotError(
                "this snapshot is not in order: it names particles or bodies that there are not"
            )
    bounds: list[tuple[Any, float]] = [
        (state.particle_position, POSITION_LIMIT),
        (state.particle_velocity, VELOCITY_LIMIT),
    ]
    for field, highest in bounds:
        values = _rows(table, words, state, PARTICLE, field).view(np.float32)
        if not np.abs(values).max() <= highest:
            raise SnapshotError("this snapshot is not in order: particles are out of reach, or not finite")
    for owner, field in steering(state):
        if not np.isfinite(_rows(table, words, state, owner, field).view(np.float32)).all():
            raise SnapshotError("this snapshot is not in order: what moves its bodies is not finite")
    for each in context.slices:
        try:
            each.require(manifest.slices[each.name], partial(_field_rows, table, words, state))
        except ValueError as error:
            raise SnapshotError(f"this snapshot is not in order: {error}") from None
    lives = _rows(table, words, state, BODY, state.body_status)[:, 0] != ABSENT
    if lives.tolist() != [body is not None for body in manifest.bodies]:
        raise SnapshotError("this snapshot is not in order: it is not sure who lives")


def steering(state: State) -> list[tuple[int, Any]]:
    """Fields of real numbers that the next step begins with, beside positions and velocities."""
    particle = [state.prev_position, state.prev_velocity, state.particle_mass, state.particle_inv_mass]
    particle += [state.particle_target, state.particle_push]
    body = [state.body_velocity_lag, state.body_gravity_scale, state.body_damping, state.body_sound_speed]
    body += [state.body_refinement]
    shape = [state.tet_rest_inverse] if state.capacity.plastic else []
    owners = (PARTICLE, particle), (BODY, body), (SHAPE, shape)
    return [(owner, field) for owner, fields in owners for field in fields] + [(WORLD, state.wind)]


def _field_rows(table: Words, words: Words, state: State, field: Any) -> NDArray[Any]:
    """What a snapshot holds for a field of a slice, (rows, width), in the field's type."""
    owner = next(each for each in owners(state) if any(f is field for f, _, _ in carried(state, each)))
    rows = _rows(table, words, state, owner, field)
    return rows if field.dtype == ti.i32 else rows.view(np.float32)


def _rows(table: Words, words: Words, state: State, owner: int, wanted: Any) -> Words:
    """What a snapshot holds for a field, (rows, width)."""
    count, width, begin = table[owner].tolist()
    rows = words[begin : begin + count * width].reshape(count, width)
    for field, column, size in carried(state, owner):
        if field is wanted:
            return np.ascontiguousarray(rows[:, column : column + size])
    raise KeyError(owner)
