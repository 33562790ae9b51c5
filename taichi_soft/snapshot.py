"""The state of a world between two steps, as bytes and back.

A snapshot has three parts. The *structure* is what the world was built of; a world of another structure
refuses it. The *notes* are what Python knows: time, who lives in which slot, colliders, frames, grabs. The
*words* are what the fields hold, bit by bit (see `kernels.snapshot`), and the parts of meshes that cuts have
left (see `parts`).
"""

from __future__ import annotations

from hashlib import blake2b
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.constants import POSITION_LIMIT, VELOCITY_LIMIT
from taichi_soft.errors import SnapshotError, StateError
from taichi_soft.kernels.pins import WITH_FRAME
from taichi_soft.kernels.snapshot import (
    BODY,
    GRAB,
    HELD,
    PARTICLE,
    PATCH,
    carried,
    copy_state,
    hash_bodies,
    row_table,
)
from taichi_soft.notes import Notes, read_notes, read_parts, take_notes
from taichi_soft.plain import from_json, to_json
from taichi_soft.restoring import put_back
from taichi_soft.sealed import seal, unseal
from taichi_soft.state import ABSENT, PATCH_ROWS, State
from taichi_soft.structure import require_structure

if TYPE_CHECKING:
    from taichi_soft.world import World

MARK, VERSION = b"TSOFTSNP", 2

Words = NDArray[np.int32]


def take_snapshot(world: World) -> bytes:
    """As `World.snapshot`."""
    state = world._built.state
    table = _table(world, max(world._grabs, default=-1) + 1)
    words = np.empty(int(table[-1, 2]), dtype=np.int32)
    copy_state(state, table, words, True)
    words = np.concatenate([words, *(body._part.rows for body in world.bodies if body._part is not None)])
    return seal(MARK, VERSION, [world._structure, to_json(take_notes(world)), words.astype("<i4").tobytes()])


def state_hash(world: World) -> str:
    """As `World.state_hash`."""
    code = int(hash_bodies(world._built.state, world.slot_count))
    return blake2b(to_json([code, take_notes(world)]), digest_size=8).hexdigest()


def _table(world: World, held: int) -> Words:
    scene = world._scene
    return row_table(world._built.state, scene.particle_count, world.slot_count, scene.block_count, held)


def restore_snapshot(world: World, data: Any) -> None:
    """As `World.restore`."""
    state = world._built.state
    structure, content, rows = _three(unseal(data, MARK, VERSION, "snapshot"))
    require_structure(bytes(structure), world._structure)
    plain = from_json(content)
    try:
        words = np.frombuffer(rows, "<i4").astype(np.int32)
        table = _table(world, max((int(number) for _, number, _, _ in plain["grabs"]), default=-1) + 1)
        if len(words) < table[-1, 2]:
            raise ValueError(f"it has {len(words)} words, where this world takes {table[-1, 2]}")
        parts = read_parts(world, plain["bodies"], words[table[-1, 2] :])
        words = words[: table[-1, 2]]
        notes = read_notes(world, plain, parts)
    except (KeyError, TypeError, ValueError, IndexError, OverflowError, AttributeError, StateError) as error:
        if isinstance(error, SnapshotError):
            raise
        raise SnapshotError(f"this snapshot is not in order: {error}") from None
    _require_words(world, notes, table, words)
    put_back(world, notes)
    copy_state(state, table, words, False)


def _three(parts: list[memoryview]) -> list[memoryview]:
    if len(parts) != 3:
        raise SnapshotError(f"this snapshot has {len(parts)} parts instead of 3")
    return parts


def _require_words(world: World, notes: Notes, table: Words, words: Words) -> None:
    """Raises: SnapshotError where a kernel would read beyond its fields, or begin with what is not finite."""
    state = world._built.state
    particles, slots = world._scene.particle_count, world.slot_count
    limits: list[tuple[int, Any, int]] = [
        (PARTICLE, state.particle_aim, WITH_FRAME + len(notes.frames)),
        (BODY, state.body_status, ABSENT + 1),
        (GRAB, state.grab_body, slots + 1),
        (HELD, state.grab_corners, particles),
        (HELD, state.grab_count, PATCH_ROWS + 1),
        (PATCH, state.patch_particle, particles),
    ]
    for owner, field, limit in limits:
        rows = _rows(table, words, state, owner, field)
        if rows.size and not (rows.min() >= 0 and rows.max() < limit):
            raise SnapshotError(
                "this snapshot is not in order: it names particles or bodies that there are not"
            )
    for field, highest in (
        (state.particle_position, POSITION_LIMIT),
        (state.particle_velocity, VELOCITY_LIMIT),
    ):
        values = _rows(table, words, state, PARTICLE, field).view(np.float32)
        if not np.abs(values).max() <= highest:
            raise SnapshotError("this snapshot is not in order: particles are out of reach, or not finite")
    lives = _rows(table, words, state, BODY, state.body_status)[:, 0] != ABSENT
    if lives.tolist() != [body is not None for body in notes.bodies]:
        raise SnapshotError("this snapshot is not in order: it is not sure who lives")


def _rows(table: Words, words: Words, state: State, owner: int, wanted: Any) -> Words:
    """What a snapshot holds for a field, (rows, width)."""
    count, width, begin = table[owner].tolist()
    rows = words[begin : begin + count * width].reshape(count, width)
    for field, column, size in carried(state, owner):
        if field is wanted:
            return np.ascontiguousarray(rows[:, column : column + size])
    raise KeyError(owner)
