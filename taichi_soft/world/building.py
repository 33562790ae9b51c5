"""Bodies and colliders of a world moved into Taichi fields, with the kernels that fit them."""

from __future__ import annotations

import warnings
import weakref
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from taichi_soft.bodies.fields import acquire, release
from taichi_soft.bodies.plasticity import RIGID_ROW
from taichi_soft.bodies.sag import review_weight
from taichi_soft.contact.clearance import free_points, require_clear
from taichi_soft.contact.colliders import ignore
from taichi_soft.contact.fields import ContactCapacity
from taichi_soft.contact.shapes import PlaneShape
from taichi_soft.core.errors import OptionError, StateError, UnstableStepWarning
from taichi_soft.core.runtime import Device, init
from taichi_soft.core.serialisation import digest_of
from taichi_soft.core.settings import Settings
from taichi_soft.core.types import Integrator, Schedule
from taichi_soft.events import EventLog, Witness
from taichi_soft.fracture.cutting import warm_up
from taichi_soft.fracture.tearing import Tears
from taichi_soft.solver.kernels.spawn import despawn_body, spawn_body
from taichi_soft.solver.program import StepProgram
from taichi_soft.solver.schedules import choose_schedule, make_launch, most_substeps
from taichi_soft.solver.simulation import Simulation
from taichi_soft.solver.state import Capacity, State

if TYPE_CHECKING:
    from taichi_soft.world.world import World


def build(world: World) -> Simulation:
    """As `World.build`, of a world that was not."""
    pools, scene, colliders, contact = world._pools, world._scene, world._colliders, world._contact
    if not pools.slots:
        raise StateError("the world is empty: call add_body or reserve before build")
    world._substeps.review()
    review_weight(pools.kinds, world.settings.gravity)
    for slot, rows in pools.starts.items():
        asset = pools.assets[slot]
        require_clear(colliders.handles, asset, free_points(asset, rows), f"body {slot}")
    device = init()
    world._built_with = [digest_of(handle.shape) for handle in colliders.all_handles]
    has_contact = (
        contact.soft or contact.sleep_speed > 0.0 or len(colliders.handles) + contact.collider_room > 0
    )
    if has_contact:
        _add_floor(world)
    settings = replace(world.settings, schedule=_schedule(world, device, has_contact))
    capacity = _capacity(world, settings, has_contact)
    program = _program(world, settings, device, has_contact)
    if settings.integrator is Integrator.EXPLICIT_EULER:
        warnings.warn(
            "explicit_euler gains energy at every substep, however short, and explodes sooner or later: "
            "it is here for comparison, leapfrog is for use",
            UnstableStepWarning,
            stacklevel=4,
        )
    state = acquire(State, capacity, program)
    weakref.finalize(world, release, state)
    _fill(world, state, program)
    _warm_up(world, state)
    for slot, rows in pools.starts.items():
        spawn_body(state, slot, rows)
    pools.starts.clear()
    _set(settings, state)
    tears = Tears(state, pools.slots) if any(asset.tearing for asset in pools.kinds) else None
    simulation = Simulation(
        settings,
        pools,
        scene,
        world._clock,
        world._frames,
        colliders if has_contact else None,
        contact.sleep_speed > 0.0,
        state,
        program,
        make_launch(settings.schedule, state, program, scene, device, settings.retries),
        most_substeps(scene, settings.integrator),
        EventLog(Witness(state, scene, pools.slots, colliders if has_contact else None)),
        tears,
    )
    if has_contact:
        state.contact.sleep_speed[None] = contact.sleep_speed
        colliders.load(state.contact, len(pools.slots))
        woken = weakref.WeakMethod(simulation.wake_near)  # or the two would keep each other
        colliders.on_jump = lambda lower, upper: (woken() or ignore)(lower, upper)
    if tears is not None:
        for body in pools.living:
            tears.watch(body)
    return simulation


def _add_floor(world: World) -> None:
    """Make the floor one of the colliders. Raises: OptionError for what takes no colliders."""
    settings = world.settings
    if settings.schedule is Schedule.FLAT:
        raise OptionError("schedule 'flat' has no colliders: it takes 'per_body' or 'auto'")
    if settings.integrator is Integrator.EXPLICIT_EULER:
        raise OptionError("integrator 'explicit_euler' has no colliders: any other has")
    if settings.floor is not None:
        world._floor_collider = world.add_collider(
            PlaneShape(),
            position=(0.0, 0.0, settings.floor),
            friction=settings.friction,
            restitution=settings.restitution,
        )


def _schedule(world: World, device: Device, has_contact: bool) -> Schedule:
    asked = world.settings.schedule
    is_cut = any(asset.spare_vertices for asset in world._pools.kinds)
    if is_cut and asked is Schedule.FLAT:
        raise OptionError("schedule 'flat' cuts no bodies: take 'per_body' or 'auto', or no spare_vertices")
    needs_bodies = world.settings.is_implicit or has_contact or is_cut
    return choose_schedule(asked, world._scene, device, needs_bodies=needs_bodies)


def _capacity(world: World, settings: Settings, has_contact: bool) -> Capacity:
    contact = ContactCapacity()
    if has_contact:
        chosen = world._contact
        contact = world._colliders.capacity(chosen.collider_room, chosen.sample_room, soft=chosen.soft)
    return Capacity.of(
        world._scene,
        parallel=settings.schedule is Schedule.FLAT,
        implicit=settings.is_implicit,
        contact=contact,
        plastic=_is_plastic(world),
    )


def _program(world: World, settings: Settings, device: Device, has_contact: bool) -> StepProgram:
    return StepProgram(
        tuple(dict.fromkeys(asset.description.model for asset in world._pools.kinds)),
        settings.integrator,
        settings.floor is not None and not has_contact,
        has_contact,
        world._contact.soft,
        _is_plastic(world),
        device.threads,
    )


def _is_plastic(world: World) -> bool:
    return any(asset.plasticity is not None for asset in world._pools.kinds)


def _fill(world: World, state: State, program: StepProgram) -> None:
    """Write all bodies into the fields, in slots that are empty yet."""
    fill, assets = state.loader.fill, world._pools.assets
    if program.has_plasticity:
        flows = [a.plasticity.row if a.plasticity else RIGID_ROW for a in assets]
        fill(state.body_plasticity, np.array(flows))
    if program.has_contact:
        fill(state.contact.body_filter, np.array([(a.contact.group, a.contact.mask) for a in assets]))
    if program.has_soft_contact:
        fill(state.soft.body_surface, np.array([a.surface_row for a in assets]))
        fill(state.soft.body_touches_itself, np.array([a.contact.itself for a in assets]))
    models = [program.models.index(asset.description.model) for asset in assets]
    kinds = np.array([(a.surface_row[2], *a.vibration_row(a.description)) for a in assets])
    state.load(world._scene, models, kinds)


def _warm_up(world: World, state: State) -> None:
    """A body that comes and goes, so that nothing compiles where the first does in the game."""
    for asset in world._pools.kinds:
        slot = world._pools.assets.index(asset)
        if asset.spare_vertices:
            warm_up(world, state, slot)
        spawn_body(state, slot, asset.rest_rows)
        despawn_body(state, slot)


def _set(settings: Settings, state: State) -> None:
    """Write the numbers that hold for all bodies."""
    state.gravity[None] = settings.gravity.tolist()
    state.retries[None] = settings.retries
    state.floor[None] = [settings.floor or 0.0, settings.restitution or 0.0, settings.friction]
    if settings.is_implicit:
        state.solver[None] = [settings.tolerance, settings.most_iterations]
