"""A world put back to earlier notes: handles that callers hold, and new ones where nobody holds any."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from taichi_soft.bodies.part import name_of
from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.contact.colliders import Collider
from taichi_soft.control.attachments import Attachment
from taichi_soft.control.frames import Frame, Frames
from taichi_soft.control.materials import write_constants
from taichi_soft.core.serialisation import as_plain
from taichi_soft.fracture.cutting import refill_slot
from taichi_soft.persistence.manifest import BodyNote, Notes
from taichi_soft.solver.context import WorldContext
from taichi_soft.solver.state import State


def put_back(context: WorldContext, notes: Notes) -> None:
    """Let a world be as its notes say, but for what the fields hold. Nothing here can be refused any more."""
    simulation, clock = context.built, context.clock
    clock.steps, clock.time, clock.last_dt = notes.steps, notes.time, notes.last_dt
    handles = context.handles
    _apply_frames(context, notes)
    colliders = context.colliders
    colliders.restore(
        [row for _, row in notes.colliders],
        lambda i, row: _handle(context, notes.colliders[i][0], Collider, lambda: Collider(colliders, i, row)),
    )
    for slot, wanted in enumerate(notes.bodies):
        _apply_body(context, simulation.state, slot, wanted)
    handles.count = notes.handles
    if simulation.tears is not None:
        for body, wanted in zip(context.slots.slots, notes.bodies, strict=True):
            if body is not None and wanted is not None:
                simulation.tears.watch(body)
                if wanted.rests:
                    simulation.tears.rest(body)
    simulation.has_changed()
    context.substeps.forget()


def _handle(context: WorldContext, serial: int, kind: type[Any], make: Callable[[], Any]) -> Any:
    """The handle of that number: the one that the caller has, or a new one."""
    found = context.handles.find(serial, kind)
    if found is None:
        found = make()
        context.handles.enlist(found, serial)
    return found


def _apply_frames(context: WorldContext, notes: Notes) -> None:
    frames = context.of(Frames)
    frames.present, frames.coming, frames.has_work = notes.present, notes.coming, notes.aims
    frames.rows = [None] * len(notes.frames)
    for number, serial in enumerate(notes.frames):
        if serial is None:
            continue
        frame = context.handles.find(serial, Frame)
        if frame is None or frame._number != number:
            frame = Frame._at(frames, number)
        context.handles.enlist(frame, serial)
        frames.rows[number] = frame


def _apply_body(context: WorldContext, state: State, slot: int, wanted: BodyNote | None) -> None:
    """Put the right body into a slot, of the right material."""
    present, asset = context.slots.slots[slot], context.slots.assets[slot]
    if present is not None and (wanted is None or present._serial != wanted.serial):
        if present._description is not asset.description and not present.is_cut:
            write_constants(state, present, asset.description)
            present._description = asset.description
        present._attachments.clear()
        context.slots.leave(present)
        present._removed_in = context.clock.steps
        present = None
    if wanted is None:
        return
    if present is not None and name_of(present._part) != name_of(wanted.part):
        refill_slot(context, state, slot, wanted.arrays)
    if present is None:
        if wanted.part is not None or context.layout.bodies[slot] is not asset.arrays:
            refill_slot(context, state, slot, wanted.arrays)
        known = context.handles.find(wanted.serial, SoftBody)
        if known is not None and known.index == slot and known.asset is asset:
            present = known
        else:
            present = context.make_body(context, slot, asset)
            context.handles.enlist(present, wanted.serial)
        present._removed_in = None
        present._description = asset.description if wanted.part is None else wanted.description
        context.slots.enter_at(present)
    if name_of(present._part) != name_of(wanted.part):
        present._become(wanted.part)
        present._description = asset.description if wanted.part is None else wanted.description
    present._first_step = wanted.first_step
    present._frozen_in, present._failure = wanted.failed, None
    if as_plain(present._description.material) != as_plain(wanted.description.material):
        write_constants(state, present, wanted.description)
    present._description = wanted.description
    present._attachments.clear()
    for serial, number, two_way, particles in wanted.attachments:
        frame = context.of(Frames).rows[number]
        assert frame is not None
        held = context.handles.find(serial, Attachment) or Attachment(
            present, particles, frame, two_way=two_way
        )
        held.body, held.frame, held.particles, held.two_way = present, frame, particles, two_way
        context.handles.enlist(held, serial)
        present._attachments.append(held)
