"""Restore the bodies of a manifest. Handles that callers still have are valid again; other bodies get new
handles.
"""

from __future__ import annotations

from dataclasses import replace

from taichi_soft.bodies.cut_mesh import name_of
from taichi_soft.bodies.description import BodyDescription
from taichi_soft.bodies.soft_body import SoftBody, present_asset, record_of
from taichi_soft.control.frictions import give_friction
from taichi_soft.control.material_constants import write_constants
from taichi_soft.core.handles import serial_of
from taichi_soft.core.serialisation import as_plain
from taichi_soft.fracture.cutting import refill_slot
from taichi_soft.persistence.manifest import BodyEntry, Manifest
from taichi_soft.solver.context import WorldContext
from taichi_soft.solver.state import State


def restore_bodies(context: WorldContext, manifest: Manifest) -> None:
    """Set the time and the bodies of a world from a manifest, without fields and slices. Never raises."""
    simulation, clock = context.built, context.clock
    clock.steps, clock.time, clock.last_dt = manifest.steps, manifest.time, manifest.last_dt
    settings = context.settings
    is_other = manifest.friction != settings.friction or manifest.floor != settings.floor
    if is_other or (manifest.gravity != settings.gravity).any():
        gravity, friction, floor = manifest.gravity, manifest.friction, manifest.floor
        context.apply_settings(replace(settings, gravity=gravity, friction=friction, floor=floor))
    for slot, entry in enumerate(manifest.bodies):
        _restore_body(context, simulation.state, slot, entry)
    simulation.was_restored()
    context.substeps.forget()


def _restore_body(context: WorldContext, state: State, slot: int, entry: BodyEntry | None) -> None:
    """Fill a slot with the body of `entry`. If `entry` is None, empty the slot."""
    present = context.slots.slots[slot]
    if present is not None and (entry is None or serial_of(present) != entry.serial):
        _remove(context, state, present)
        present = None
    if entry is None:
        return
    if present is not None and _content_of(present) != (name_of(entry.part), entry.level):
        refill_slot(context, state, slot, entry.level, entry.arrays)
        record_of(present).friction = None  # refilling the slot has restored the asset's friction
    if present is None:
        present = _insert(context, state, slot, entry)
    record = record_of(present)
    if _content_of(present) != (name_of(entry.part), entry.level):
        record.set_topology(entry.part, entry.level)
        record.description = _description_in_slot(present, entry)
    record.first_step, record.frozen_in, record.failure = entry.first_step, entry.failed, None
    record.held = entry.held
    if as_plain(record.description.material) != as_plain(entry.description.material):
        write_constants(state, present, entry.description)
    record.description = entry.description
    if record.friction != entry.friction:
        give_friction(state, present, entry.friction)


def _content_of(body: SoftBody) -> tuple[str, int]:
    """Return the name of the cut mesh and the level of detail of the body in a slot."""
    record = record_of(body)
    return name_of(record.part), record.level


def _remove(context: WorldContext, state: State, body: SoftBody) -> None:
    record, original = record_of(body), present_asset(body).description
    if record.description is not original and not body.is_cut:
        write_constants(state, body, original)
        record.description = original
    if record.friction is not None:
        give_friction(state, body, None)
    context.slots.leave(body)
    record.removed_in = context.clock.steps


def _insert(context: WorldContext, state: State, slot: int, entry: BodyEntry) -> SoftBody:
    """Insert a body into a free slot. Return its handle. The handle is new unless a caller still has one."""
    asset = context.slots.assets[slot]
    if entry.part is not None or context.layout.bodies[slot] is not asset.levels[entry.level].arrays:
        refill_slot(context, state, slot, entry.level, entry.arrays)
    body = context.handles.find(entry.serial, SoftBody)
    if body is None or body.index != slot or body.asset is not asset:
        body = context.make_body(context, slot, asset)
        context.handles.enlist(body, entry.serial)
    record = record_of(body)
    record.removed_in = None
    if _content_of(body) != (name_of(entry.part), entry.level):
        record.set_topology(entry.part, entry.level)
    record.description = _description_in_slot(body, entry)
    context.slots.enter_at(body)
    return body


def _description_in_slot(body: SoftBody, entry: BodyEntry) -> BodyDescription:
    """Return the description of the data in a body's slot, before the material of `entry` is applied."""
    return present_asset(body).description if entry.part is None else entry.description
