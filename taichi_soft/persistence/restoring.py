"""Bodies put back to an earlier manifest: handles that callers hold, and new ones where nobody holds any."""

from __future__ import annotations

from dataclasses import replace

from taichi_soft.bodies.cut_mesh import name_of
from taichi_soft.bodies.description import BodyDescription
from taichi_soft.bodies.soft_body import SoftBody, present_asset, record_of
from taichi_soft.control.constants import write_constants
from taichi_soft.control.frictions import give_friction
from taichi_soft.core.handles import serial_of
from taichi_soft.core.serialisation import as_plain
from taichi_soft.fracture.cutting import refill_slot
from taichi_soft.persistence.manifest import BodyEntry, Manifest
from taichi_soft.solver.context import WorldContext
from taichi_soft.solver.state import State


def put_back(context: WorldContext, manifest: Manifest) -> None:
    """Let time and bodies be as a manifest says, but for what fields and slices hold. Refuses nothing."""
    simulation, clock = context.built, context.clock
    clock.steps, clock.time, clock.last_dt = manifest.steps, manifest.time, manifest.last_dt
    settings = context.settings
    if (manifest.gravity != settings.gravity).any() or manifest.friction != settings.friction:
        context.apply_settings(replace(settings, gravity=manifest.gravity, friction=manifest.friction))
    for slot, wanted in enumerate(manifest.bodies):
        _put_back_body(context, simulation.state, slot, wanted)
    simulation.was_restored()
    context.substeps.forget()


def _put_back_body(context: WorldContext, state: State, slot: int, wanted: BodyEntry | None) -> None:
    """Put the right body into a slot, of the right material."""
    present = context.slots.slots[slot]
    if present is not None and (wanted is None or serial_of(present) != wanted.serial):
        _take_out(context, state, present)
        present = None
    if wanted is None:
        return
    if present is not None and _fills(present) != (name_of(wanted.part), wanted.level):
        refill_slot(context, state, slot, wanted.level, wanted.arrays)
        record_of(present).friction = None  # of its asset now
    if present is None:
        present = _put_in(context, state, slot, wanted)
    record = record_of(present)
    if _fills(present) != (name_of(wanted.part), wanted.level):
        record.set_topology(wanted.part, wanted.level)
        record.description = _before_material(present, wanted)
    record.first_step, record.frozen_in, record.failure = wanted.first_step, wanted.failed, None
    record.held = wanted.held
    if as_plain(record.description.material) != as_plain(wanted.description.material):
        write_constants(state, present, wanted.description)
    record.description = wanted.description
    if record.friction != wanted.friction:
        give_friction(state, present, wanted.friction)


def _fills(body: SoftBody) -> tuple[str, int]:
    """What of its asset is in its slot."""
    record = record_of(body)
    return name_of(record.part), record.level


def _take_out(context: WorldContext, state: State, body: SoftBody) -> None:
    record, whole = record_of(body), present_asset(body).description
    if record.description is not whole and not body.is_cut:
        write_constants(state, body, whole)
        record.description = whole
    if record.friction is not None:
        give_friction(state, body, None)
    context.slots.leave(body)
    record.removed_in = context.clock.steps


def _put_in(context: WorldContext, state: State, slot: int, wanted: BodyEntry) -> SoftBody:
    """The handle that somebody holds of who lived there, or a new one."""
    asset = context.slots.assets[slot]
    if wanted.part is not None or context.layout.bodies[slot] is not asset.levels[wanted.level].arrays:
        refill_slot(context, state, slot, wanted.level, wanted.arrays)
    body = context.handles.find(wanted.serial, SoftBody)
    if body is None or body.index != slot or body.asset is not asset:
        body = context.make_body(context, slot, asset)
        context.handles.enlist(body, wanted.serial)
    record = record_of(body)
    record.removed_in = None
    if _fills(body) != (name_of(wanted.part), wanted.level):
        record.set_topology(wanted.part, wanted.level)
    record.description = _before_material(body, wanted)
    context.slots.enter_at(body)
    return body


def _before_material(body: SoftBody, wanted: BodyEntry) -> BodyDescription:
    """What a slot was filled with, before it is given another material."""
    return present_asset(body).description if wanted.part is None else wanted.description
