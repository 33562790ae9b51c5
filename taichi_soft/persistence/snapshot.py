"""Convert the state of a world between two steps to bytes and back.

A snapshot has four parts. The *structure* describes how the world was built; a world with a different
structure rejects the snapshot. The *manifest* contains the state outside the fields: time, gravity, the body
in each slot, and the entries of each slice (colliders, frames, joints ...). The *words* contain exact copies
of the fields (see `persistence.kernels.packing`) and the meshes of cut bodies (see `bodies.cut_mesh`). The
last part is the state of the events (see `events.event_state`).
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
from taichi_soft.core.constants import LANES
from taichi_soft.core.container import seal, unseal
from taichi_soft.core.errors import SnapshotError, StateError
from taichi_soft.core.field_table import BODY, COLLIDER, CONTACT, CONTACT_EDGE, PARTICLE, SHAPE, WORLD
from taichi_soft.core.runtime import ti
from taichi_soft.core.serialisation import from_json, to_json
from taichi_soft.events import EventState, HandleLookup
from taichi_soft.persistence.kernels.packing import copy_state, hash_bodies, row_table
from taichi_soft.persistence.manifest import Manifest, read_manifest, read_parts, write_manifest
from taichi_soft.persistence.restoring import restore_bodies
from taichi_soft.persistence.world_structure import require_structure, structure_of
from taichi_soft.solver.context import WorldContext
from taichi_soft.solver.state import State

MARK, VERSION = b"TSOFTSNP", 14

Words = NDArray[np.int32]


def take_snapshot(context: WorldContext) -> bytes:
    """See `World.snapshot`."""
    state = context.built.state
    manifest = write_manifest(context)
    table = _table(context, manifest["slices"])
    words = np.empty(int(table[-1, 2]), dtype=np.int32)
    copy_state(state, table, words, True)
    parts = [record_of(body).part for body in context.slots.occupants]
    words = np.concatenate([words, *(part.rows for part in parts if part is not None)])
    event_part = to_json(context.built.events.save().plain)
    content = [to_json(manifest), words.astype("<i4").tobytes(), event_part]
    return seal(MARK, VERSION, [_structure(context), *content])


def _structure(context: WorldContext) -> bytes:
    """Return the structure of a world from `structure_of`, and cache it."""
    if not context.structure:
        context.structure = structure_of(context)
    return context.structure


def state_hash(context: WorldContext) -> str:
    """See `World.state_hash`."""
    code = int(hash_bodies(context.built.state, len(context.slots.slots)))
    return blake2b(to_json([code, write_manifest(context)]), digest_size=8).hexdigest()


def bodies_hash(context: WorldContext) -> str:
    """See `World.bodies_hash`."""
    code = int(hash_bodies(context.built.state, len(context.slots.slots)))
    return f"{code % 2**64:016x}"


def row_counts(context: WorldContext, entries: dict[str, list[list[Any]]]) -> dict[str, int]:
    """Return the number of rows of each group of fields in a snapshot.

    Args:
        context: context of the world.
        entries: entries of the slices in the manifest, by name.
    """
    scene, slots = context.layout, len(context.slots.slots)
    counts = {
        WORLD: 1,
        PARTICLE: scene.particle_count,
        BODY: slots,
        SHAPE: scene.block_count * 9 * LANES,
        CONTACT: slots * context.built.state.capacity.contact.colliders,
        CONTACT_EDGE: scene.contact_edge_count,
    }
    for each in context.slices:
        counts |= each.row_counts(entries[each.name])
    return counts


def _table(context: WorldContext, entries: dict[str, list[list[Any]]]) -> Words:
    """Return the layout of the words in a snapshot, from `row_table`."""
    return row_table(context.built.state, row_counts(context, entries))


def restore_snapshot(context: WorldContext, data: Any, *, keeps_events: bool = False) -> None:
    """See `World.restore`.

    Args: keeps_events: True to keep the queued events if no step has been made since the snapshot.
    """
    state = context.built.state
    structure, content, rows, event_part = _four_parts(unseal(data, MARK, VERSION, "snapshot"))
    require_structure(bytes(structure), _structure(context))
    plain = from_json(content)
    try:
        words = np.frombuffer(rows, "<i4").astype(np.int32)
        table = _table(context, plain["slices"])
        if len(words) < table[-1, 2]:
            raise ValueError(f"it has {len(words)} words, but this world needs {table[-1, 2]}")
        parts = read_parts(context, plain["bodies"], words[table[-1, 2] :])
        words = words[: table[-1, 2]]
        manifest = read_manifest(context, plain, parts)
        event_state = EventState.of(from_json(event_part), len(context.slots.slots))
    except (KeyError, TypeError, ValueError, IndexError, OverflowError, AttributeError, StateError) as error:
        if isinstance(error, SnapshotError):
            raise
        raise SnapshotError(f"this snapshot is invalid: {error}") from None
    _require_words(context, manifest, table, words)
    restore_bodies(context, manifest)
    for each in context.slices:
        each.clear()
    copy_state(state, table, words, False)
    for each in context.slices:
        each.restore(manifest.slices[each.name])
    context.handles.count = manifest.handles
    find = context.handles.find
    lookup = HandleLookup(lambda serial: find(serial, SoftBody), lambda serial: find(serial, Collider))
    if not keeps_events:
        context.built.events.drop_since(manifest.steps)
    context.built.events.restore(event_state, manifest.steps, lookup)


def _four_parts(parts: list[memoryview]) -> list[memoryview]:
    if len(parts) != 4:
        raise SnapshotError(f"this snapshot is invalid: it has {len(parts)} parts instead of 4")
    return parts


def _require_words(context: WorldContext, manifest: Manifest, table: Words, words: Words) -> None:
    """Check the values of fields in a snapshot. Raises: SnapshotError for invalid indices or values."""
    state = context.built.state
    things = {
        "": 0,
        PARTICLE: context.layout.particle_count,
        BODY: len(context.slots.slots),
        COLLIDER: state.capacity.contact.colliders,
    }
    for each in context.slices:
        things |= each.things(manifest.slices[each.name])
    for name, declared, field in state.fields:
        if state.is_kept(declared) and declared.is_bounded:
            rows = _rows(table, words, state, field)
            try:
                declared.require(rows if field.dtype == ti.i32 else rows.view(np.float32), things)
            except ValueError as error:
                raise SnapshotError(f"this snapshot is invalid: its {name} {error}") from None
    for each in context.slices:
        try:
            each.require(manifest.slices[each.name], partial(_field_rows, table, words, state))
        except ValueError as error:
            raise SnapshotError(f"this snapshot is invalid: {error}") from None
    is_present = _rows(table, words, state, state.body_status)[:, 0] != ABSENT
    if is_present.tolist() != [body is not None for body in manifest.bodies]:
        raise SnapshotError("this snapshot is invalid: its fields and its manifest name different bodies")


def _field_rows(table: Words, words: Words, state: State, field: Any) -> NDArray[Any]:
    """Return the values of a field in a snapshot, (rows, width), as integers or float32."""
    rows = _rows(table, words, state, field)
    return rows if field.dtype == ti.i32 else rows.view(np.float32)


def _rows(table: Words, words: Words, state: State, requested: Any) -> Words:
    """Return the words of a field in a snapshot, (rows, width)."""
    for (count, width, begin), group in zip(table.tolist(), state.kept.values(), strict=False):
        for field, column, size in group:
            if field is requested:
                rows = words[begin : begin + count * width].reshape(count, width)
                return np.ascontiguousarray(rows[:, column : column + size])
    raise KeyError(requested)
