"""Build a world: allocate its fields, fill them, and choose its kernels."""

from __future__ import annotations

import logging
import warnings
import weakref
from dataclasses import replace

import numpy as np

from taichi_soft.bodies.capacity import room_for
from taichi_soft.bodies.fields import acquire, release
from taichi_soft.bodies.plasticity import RIGID_ROW
from taichi_soft.bodies.sag import review_weight
from taichi_soft.contact.clearance import free_points, require_clear
from taichi_soft.contact.colliders import ignore
from taichi_soft.contact.fields import ContactCapacity
from taichi_soft.contact.shapes import PlaneShape
from taichi_soft.control.easing import Easings
from taichi_soft.control.frames import Frames
from taichi_soft.control.joints import Joints
from taichi_soft.core.conflicts import FLAT, FLAT_SOLVES, ONLY_FLAT, SOLVED
from taichi_soft.core.constants import ALL_GROUPS
from taichi_soft.core.errors import OptionError, StateError, UnstableStepWarning
from taichi_soft.core.runtime import Device, init
from taichi_soft.core.serialisation import digest_of
from taichi_soft.core.settings import ContactSettings, Settings
from taichi_soft.core.types import Schedule
from taichi_soft.events import EventLog, Observer
from taichi_soft.fracture.cutting import warm_up
from taichi_soft.fracture.tearing import Tears
from taichi_soft.solver.context import WorldContext
from taichi_soft.solver.integrators import INTEGRATORS
from taichi_soft.solver.kernels.spawn import despawn_body, spawn_body
from taichi_soft.solver.program import StepProgram
from taichi_soft.solver.schedules import choose_schedule, make_launch, substeps_per_call
from taichi_soft.solver.simulation import Simulation
from taichi_soft.solver.state import Capacity, State
from taichi_soft.solver.substeps import FRAME

_log = logging.getLogger(__name__)


def build(context: WorldContext) -> Simulation:
    """Implement `World.build`."""
    pools, scene, colliders = context.slots, context.layout, context.colliders
    if not pools.slots:
        raise StateError("the world is empty: call add_body or reserve before build")
    context.substeps.review()
    review_weight(pools.kinds, context.settings.gravity)
    for slot, rows in pools.starts.items():
        asset = pools.assets[slot]
        require_clear(colliders.handles, asset, free_points(asset, rows), f"body {slot}")
    device = init()
    context.built_with = [digest_of(handle.shape) for handle in colliders.all_handles]
    settings = replace(context.settings, schedule=_schedule(context, device))
    contact = context.contact_request.settings(
        can_touch=pools.can_touch, is_flat=settings.schedule is Schedule.FLAT
    )
    context.first_floor = settings.floor
    has_contact = settings.schedule is Schedule.PER_BODY
    if has_contact:
        _add_floor(context)
    capacity = _capacity(context, settings, contact, has_contact)
    program = _program(context, settings, contact, device, has_contact)
    if program.integrator.warning:
        warnings.warn(program.integrator.warning, UnstableStepWarning, stacklevel=4)
    state = acquire(State, capacity, program)
    weakref.finalize(context, release, state)
    _fill(context, contact, state, program)
    _warm_up(context, state)
    for slot, rows in pools.starts.items():
        spawn_body(state, slot, rows, *pools.assets[slot].contact.filter)
    pools.starts.clear()
    state.write_surroundings(settings)
    tears = context.of(Tears)
    tears.activate(state, program)
    simulation = Simulation(
        settings,
        pools,
        scene,
        context.clock,
        context.of(Frames),
        context.of(Easings),
        context.of(Joints),
        colliders if has_contact else None,
        contact.sleep_speed > 0.0,
        state,
        program,
        make_launch(settings.schedule, state, program, scene, device, settings.retries),
        substeps_per_call(scene, program.integrator),
        EventLog(Observer(state, program, scene, pools.slots, colliders if has_contact else None)),
        tears,
    )
    if has_contact:
        colliders.load(state.colliders, len(pools.slots))
        woken = weakref.WeakMethod(simulation.wake_near)  # a strong reference would create a cycle
        colliders.on_jump = lambda lower, upper: (woken() or ignore)(lower, upper)
    _log.info(
        "built a world of %d slots for bodies and %d tetrahedra: schedule %s, %s, %s; %d substeps in 1/60 s",
        len(pools.slots),
        sum(len(body.tet_vertices) for body in scene.bodies),
        settings.schedule.value,
        settings.integrator.value,
        "with contact" if has_contact else "without contact",
        context.substeps.stable_count(FRAME),
    )
    return simulation


def _add_floor(context: WorldContext) -> None:
    """Add a collider for the floor."""
    settings = context.settings
    if settings.floor is not None:
        floor = context.colliders.floor = context.colliders.add(
            PlaneShape(),
            position=(0.0, 0.0, settings.floor),
            rotation=None,
            friction=settings.friction,
            restitution=settings.restitution,
            thickness=0.0,
            group=1,
            mask=ALL_GROUPS,
        )
        context.handles.enlist(floor)


def _schedule(context: WorldContext, device: Device) -> Schedule:
    """Choose the schedule of a world. Raises: OptionError if a feature excludes the requested schedule."""
    settings, request = context.settings, context.contact_request
    asked = settings.schedule
    integrator = INTEGRATORS[settings.integrator]
    if integrator.only_flat:
        if asked is Schedule.PER_BODY:
            raise OptionError(ONLY_FLAT.message(f"integrator '{settings.integrator.value}'"))
        asked = Schedule.FLAT
    for feature, is_asked in {
        "bodies that are cut or have levels of detail": any(
            asset.spare_vertices or asset.coarser for asset in context.slots.kinds
        ),
        "hulls": _has_hulls(context),
        "shells": _has_shells(context),
        "rods": _has_rods(context),
        "colliders": len(context.colliders.handles) + (request.collider_room or 0) > 0,
        "soft contact": bool(request.soft),
        "sleep": (request.sleep_speed or 0.0) > 0.0,
        FLAT_SOLVES.features: integrator.takes_solves,
    }.items():
        if is_asked and asked is Schedule.FLAT:
            raise OptionError(FLAT.message(feature=feature))
        if is_asked:
            asked = Schedule.PER_BODY
    if asked is Schedule.AUTO and context.contact.soft:
        asked = Schedule.PER_BODY
    if not integrator.has_hulls and _has_hulls(context):
        raise OptionError(SOLVED.message(feature="hulls"))
    if integrator.takes_solves and _has_shells(context):
        raise OptionError(SOLVED.message(feature="shells"))
    if integrator.takes_solves and _has_rods(context):
        raise OptionError(SOLVED.message(feature="rods"))
    return choose_schedule(asked, context.layout, device)


def _capacity(
    context: WorldContext, settings: Settings, contact: ContactSettings, has_contact: bool
) -> Capacity:
    room = ContactCapacity()
    if has_contact:
        room = context.colliders.capacity(contact.collider_room, contact.sample_room, soft=contact.soft)
        edges = room_for(_contact_edges(context), "contact_edges") if contact.soft else 0
        is_rigid = any(asset.description.is_rigid for asset in context.slots.kinds)
        room = replace(room, hull=_has_hulls(context), rigid=is_rigid, edges=edges)
    return Capacity.of(
        context.layout,
        parallel=settings.schedule is Schedule.FLAT,
        implicit=INTEGRATORS[settings.integrator].takes_solves,
        contact=room,
        plastic=_is_plastic(context),
    )


def _contact_edges(context: WorldContext) -> int:
    """Assign rows of contact edges to the slots of a world. Returns: the number of rows."""
    assets = context.slots.assets
    levels = [[level.arrays for level in asset.levels] for asset in assets]
    context.layout.assign_contact_edges(levels, [asset.spare_vertices for asset in assets])
    return context.layout.contact_edge_count


def _program(
    context: WorldContext, settings: Settings, contact: ContactSettings, device: Device, has_contact: bool
) -> StepProgram:
    return StepProgram(
        tuple(dict.fromkeys(asset.description.model for asset in context.slots.kinds)),
        INTEGRATORS[settings.integrator],
        settings.floor is not None and not has_contact,
        has_contact,
        contact.soft,
        _is_plastic(context),
        device.threads if settings.schedule is Schedule.FLAT else 1,
    )


def _has_hulls(context: WorldContext) -> bool:
    return any(asset.hull is not None for asset in context.slots.kinds)


def _has_shells(context: WorldContext) -> bool:
    return any(asset.description.model.is_shell for asset in context.slots.kinds)


def _has_rods(context: WorldContext) -> bool:
    return any(asset.description.model.is_rod for asset in context.slots.kinds)


def _is_plastic(context: WorldContext) -> bool:
    return any(asset.plasticity is not None for asset in context.slots.kinds)


def _fill(context: WorldContext, contact: ContactSettings, state: State, program: StepProgram) -> None:
    """Write the data of all bodies to the fields. The slots stay empty."""
    fill, assets = state.loader.fill, context.slots.assets
    if program.has_plasticity:
        flows = [a.plasticity.row if a.plasticity else RIGID_ROW for a in assets]
        fill(state.body_plasticity, np.array(flows))
    if program.has_contact:
        fill(state.sleep_speed, np.array([contact.sleep_speed]))
    if program.has_soft_contact:
        fill(state.soft.body_touches_itself, np.array([a.contact.itself for a in assets]))
    fill(state.body_filter, np.array([a.contact.filter for a in assets]))
    fill(state.body_surface, np.array([a.surface_row for a in assets]))
    models = [program.models.index(asset.description.model) for asset in assets]
    kinds = [asset.kind_row(is_implicit=state.capacity.implicit) for asset in assets]
    state.load(context.layout, models, np.array(kinds))


def _warm_up(context: WorldContext, state: State) -> None:
    """Spawn and despawn a body of each kind, so that spawning compiles nothing during the game."""
    for asset in context.slots.kinds:
        slot = context.slots.assets.index(asset)
        if asset.spare_vertices or asset.coarser:
            warm_up(context, state, slot)
        spawn_body(state, slot, asset.rest_rows, *asset.contact.filter)
        despawn_body(state, slot)
