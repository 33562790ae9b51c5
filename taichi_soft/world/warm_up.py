"""Call every function of a world once, so that nothing compiles during the game.

Taichi compiles a kernel at its first call, which takes 0.1 s to 1 s with an empty cache.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import cast

import numpy as np

from taichi_soft.bodies.kernels.readout import read_exact_positions
from taichi_soft.bodies.render_mesh import warm_up as warm_up_render_meshes
from taichi_soft.bodies.skin_mesh import warm_up as warm_up_skins
from taichi_soft.bodies.soft_body import record_of
from taichi_soft.contact.filters import filter_of
from taichi_soft.contact.kernels.filters import write_filter
from taichi_soft.contact.shapes import SphereShape
from taichi_soft.control.drives import accelerate_bodies, set_wind
from taichi_soft.control.frictions import give_friction
from taichi_soft.control.impulses import apply_radial_impulse
from taichi_soft.control.rigid_transform import carry
from taichi_soft.core.types import Schedule
from taichi_soft.levels.level_change import reason_against_level_change
from taichi_soft.levels.passage import prepare
from taichi_soft.persistence.snapshot import restore_snapshot, state_hash, take_snapshot
from taichi_soft.queries import (
    cast_ray,
    cast_rays,
    cast_shape,
    find_closest_point,
    find_in_box,
    find_in_sphere,
    targets_of,
)
from taichi_soft.solver.context import WorldContext
from taichi_soft.solver.kernels.spawn import disable_body, enable_body
from taichi_soft.solver.origin import shift_origin
from taichi_soft.solver.substeps import FRAME
from taichi_soft.world.body import Body
from taichi_soft.world.spawning import enter

SHORTEST = 1e-6
"""Length of a trial step [s]. It is so short that no visible motion occurs."""

UP = np.array([0.0, 0.0, 1.0])


def warm_up_step(context: WorldContext) -> None:
    """Compile only the kernels of a step. Afterwards, the state of the world is bit-identical."""
    before = take_snapshot(context)
    try:
        context.built.trial_step(SHORTEST)
    finally:
        restore_snapshot(context, before, keeps_events=True)
    _find_stable_step(context)


def warm_up(context: WorldContext) -> None:
    """Implement `World.warm_up`."""
    before = take_snapshot(context)
    try:
        context.built.trial_step(SHORTEST)
        _fill_pools(context)
        bodies = cast("tuple[Body, ...]", context.slots.occupants)
        for body in bodies:
            _free(context, body)
        if _has_drives(context):
            set_wind(context, (1.0, 0.0, 0.0), 1.2, 1.0)
        context.built.skip([body.index for body in bodies])
        context.built.trial_step(SHORTEST)
        accelerate_bodies([(body, np.ones_like(body.positions())) for body in bodies])
        apply_radial_impulse(context, (0.0, 0.0, 0.0), 0.0, 1.0)
        for body in {body.asset: body for body in bodies}.values():
            _control(context, body, next((each for each in bodies if each is not body), None))
            _measure(context, body)
        for asset in context.slots.kinds:
            prepare(asset)
        warm_up_render_meshes(context.built.state, context.slots.kinds)
        if any(asset.skin for asset in context.slots.assets):
            warm_up_skins(context.built.state)
        _ask(context)
        context.built.trial_step(SHORTEST)
        context.built.events.warm_up()
    finally:
        restore_snapshot(context, before, keeps_events=True)
    state_hash(context)
    _find_stable_step(context)


def _find_stable_step(context: WorldContext) -> None:
    """Compute the stable step of the world if it is not yet known."""
    if context.slots.occupants:
        context.substeps.stable_count(FRAME)


def _fill_pools(context: WorldContext) -> None:
    """Spawn bodies until each kind has a body and the world has at least two bodies, if slots are free."""
    pools = context.slots
    for wanted in (1, 2):
        for asset in pools.kinds:
            is_needed = len(pools.occupants) < wanted or all(
                body.asset is not asset for body in pools.occupants
            )
            if is_needed and pools.free_slots(asset):
                above = (context.settings.floor or 0.0) + float(np.abs(asset.mesh.vertices).max())
                enter(context, asset, asset.placed(above * UP, None, 0.0 * UP, 0.0 * UP, None))


def _has_drives(context: WorldContext) -> bool:
    """True if the schedule supports forces, wind and damping."""
    return context.settings.schedule is not Schedule.FLAT


def _free(context: WorldContext, body: Body) -> None:
    """Release a body from all constraints, and reactivate a frozen body."""
    for each in context.slices:
        each.release_body(body)
    if len(body.pinned):
        body.unpin()
    if body.is_frozen:
        body.set_motion(body.mesh.vertices, 0.0 * body.mesh.vertices)


def _control(context: WorldContext, body: Body, other: Body | None) -> None:
    """Call every control of a body."""
    place = body.center_of_mass()
    if _has_drives(context):
        body.apply_force(UP)
        body.set_linear_damping(0.1)
        disable_body(context.built.state, body.index)
        enable_body(context.built.state, body.index)
    body.apply_impulse(0.0 * UP)
    body.apply_impulse_at_point(0.0 * UP, place, 1e6)
    body.set_velocity(0.0 * UP)
    body.set_gravity_scale(body.gravity_scale)
    body.set_sheltered(True)
    if body.asset.coarser and not reason_against_level_change(body):
        level, version = body.level, body.topology_version
        for other_level in (1 if level == 0 else 0, level):
            body.set_level(other_level)
        record_of(body).topology_version = version  # keeps render meshes valid
    body.set_material(body.material)
    give_friction(context.built.state, body, record_of(body).friction)
    write_filter(context.built.state, body.index, *filter_of(body))
    body.pin([0])
    body.set_targets([0], body.positions()[:1])
    context.built.trial_step(SHORTEST)
    body.unpin([0])
    for each in context.slices:
        each.warm_up(body, other, partial(context.built.trial_step, SHORTEST))
    carry([body], np.eye(3), place, place, keep=True)  # the kernels of `teleport`, without its checks
    body.set_motion(body.mesh.vertices, 0.0 * body.mesh.vertices)  # its motion may be out of range


def _measure(context: WorldContext, body: Body) -> None:
    """Call the measurements of a body that compile kernels."""
    _ = body.positions(), body.velocities(), body.pinned
    read_exact_positions(context.built.state, body.index, np.zeros(body.mesh.vertices.shape))
    if len(body.tets) and not body.asset.description.is_rigid:
        body.tet_stress()
    if body.asset.plasticity is not None:
        body.plastic_strains()  # compiles a kernel that stress and tearing also use


def _ask(context: WorldContext) -> None:
    """Call every query."""
    context.built.islands()
    shift_origin(context, (0.0, 0.0, 0.0))
    targets, far = targets_of(context), np.array([0.0, 0.0, 1e4])
    if context.built.program.has_contact:
        # Row 0 exists even in a world without colliders. There it contains zeros, which nothing hits.
        row, pose = np.zeros(1, np.int32), np.array([[0, 0, 0, 0, 0, 0, 1]], dtype=np.float32)
        targets = replace(targets, colliders=row, poses=pose)
    cast_ray(targets, far, -UP, math.inf, True)
    for count in (1, 1000):  # one kernel traces few rays in one thread, another traces many in all threads
        cast_rays(targets, np.tile(far, (count, 1)), np.tile(-UP, (count, 1)), math.inf, True)
    cast_shape(targets, SphereShape(1.0), far, -UP, None, math.inf)
    find_closest_point(targets, far, math.inf)
    find_in_sphere(targets, far, 1.0)
    find_in_box(targets, far, (1.0, 1.0, 1.0), None)
