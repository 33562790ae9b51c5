"""Describe a world as named arrays for its world file. The world file does not contain kernels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.bodies.description import outer_vertices
from taichi_soft.bodies.soft_body import record_of
from taichi_soft.contact.collider import FASTEST_SPIN, ColliderRow, row_of
from taichi_soft.contact.shapes.shape import SEAM
from taichi_soft.control.drives import MAX_ACCELERATION
from taichi_soft.control.frames import Frames
from taichi_soft.control.grab_patch import LIMITS, elements_of, wave_speed
from taichi_soft.control.grabs import HIGHEST_SPEED, WEIGHTS
from taichi_soft.control.impulses import LARGEST_IMPULSE
from taichi_soft.control.kernels.grabs import MOST_GRABS, PATCH_ROWS, PATCHES, USED_GRABS
from taichi_soft.control.kernels.joints import ENDS, JOINT_ENDS, USED_JOINT_ROWS
from taichi_soft.control.kernels.motors import ALL_MOTORS, MOST_MOTORS, MOTOR_PARTICLES, USED_MOTORS
from taichi_soft.core.checks import LONGEST_STEP, SHORTEST_STEP
from taichi_soft.core.constants import GRAVITY_EARTH, POSITION_LIMIT, VELOCITY_LIMIT
from taichi_soft.events.contacts import CONTACT_PAUSE
from taichi_soft.events.log import MAX_EVENTS
from taichi_soft.events.observer import touch_rows
from taichi_soft.export.archive import words
from taichi_soft.export.layout import FLOAT, WHOLE, image_of, places_of
from taichi_soft.export.levels import constant_names, passage_arrays, slot_arrays
from taichi_soft.export.meshes import ExportedMesh
from taichi_soft.meshing import BodyMesh
from taichi_soft.meshing.rigid_mesh import RigidMesh
from taichi_soft.persistence.manifest import write_manifest
from taichi_soft.persistence.snapshot import row_counts
from taichi_soft.solver.context import WorldContext

Arrays = dict[str, NDArray[Any]]

_ALWAYS, _OF_JOINTS, _OF_MOTORS = range(3)
"""Codes for the rows of a field in a snapshot. _ALWAYS: the number of rows is fixed. _OF_JOINTS: the
number is per row of joints in use. _OF_MOTORS: the number is per motor particle in use.
`scene.hpp` declares the same codes."""


def description_of(
    context: WorldContext, meshes: Sequence[ExportedMesh], names: Mapping[str, Sequence[str]], axes: Any
) -> Arrays:
    """Return all arrays of a world, by name. `engine_adapter/native/src/scene.cpp` reads them."""
    arrays: Arrays = {
        "host_axes": np.asarray(axes, dtype=np.float64),
        **{f"names/{kind}": words(each) for kind, each in names.items()},
        **_of_world(context),
        **_of_fields(context),
        **_of_frames(context),
    }
    for number, asset in enumerate(context.slots.kinds):
        for level, each in enumerate(asset.levels):
            arrays |= _within(_prefix(number, level), _of_asset(each))
            if asset.coarser:
                arrays |= _within(_prefix(number, level), slot_arrays(context, number, each))
        arrays |= _within(f"asset{number}/", passage_arrays(asset))
    for number, mesh in enumerate(meshes):
        arrays |= _within(f"mesh{number}/", _of_mesh(mesh))
    if context.built.colliders is not None:
        arrays |= _of_colliders([row_of(each) for each in context.colliders.all_handles])
    return arrays


def _within(prefix: str, arrays: Arrays) -> Arrays:
    return {prefix + name: each for name, each in arrays.items()}


def _prefix(number: int, level: int) -> str:
    return f"asset{number}/level{level}/" if level else f"asset{number}/"


def _of_world(context: WorldContext) -> Arrays:
    settings, built, floor = context.settings, context.built, context.floor_collider
    share, longest = context.substeps.rule
    kinds, room = list(context.slots.kinds), built.state.capacity.contact
    slots = list(zip(context.slots.assets, context.slots.slots, strict=True))
    return {
        "world/flags": _ints(
            [built.sleeps, room.soft, built.state.capacity.implicit, built.state.capacity.rods]
        ),
        "world/counts": _ints([len(context.slots.slots), context.layout.particle_count]),
        "world/stable": _floats([share, longest]),
        "world/limits": _floats(
            [
                *(POSITION_LIMIT, VELOCITY_LIMIT, FASTEST_SPIN, LARGEST_IMPULSE, MAX_ACCELERATION),
                *(SHORTEST_STEP, LONGEST_STEP),
            ]
        ),
        "world/floor": _floats([] if settings.floor is None else [settings.floor]),
        "world/surroundings": _floats([*settings.gravity, settings.friction]),
        "world/floor_collider": _ints([-1 if floor is None or not floor.is_alive else floor.index]),
        "world/steps": np.array([context.clock.steps], dtype=np.int64),
        "world/clock": _floats([context.clock.time, context.clock.last_dt]),
        "events/limits": _floats([CONTACT_PAUSE, MAX_EVENTS, touch_rows(room, len(context.slots.slots))]),
        "grabs/limits": _floats([WEIGHTS * GRAVITY_EARTH, HIGHEST_SPEED, PATCH_ROWS]),
        "grabs/patch_limits": _floats(LIMITS),
        "slots/asset": _ints([kinds.index(asset) for asset in context.slots.assets]),
        "slots/friction": _floats(
            [asset.contact.friction if body is None else body.friction for asset, body in slots]
        ),
        "levels/counts": _ints([len(asset.levels) for asset in kinds]),
        "levels/level": _ints([0 if body is None else body.level for body in context.slots.slots]),
        **_held(context),
        "levels/constants": words(constant_names(context)),
        "slots/begin": _ints([each.particles[0] for each in context.layout.ranges]),
    }


def _of_fields(context: WorldContext) -> Arrays:
    state = context.built.state
    places = places_of(state)
    rows = row_counts(context, write_manifest(context)["slices"])
    # Reserve rows for all grabs and motors, because a game can add some. For the last three groups, give the
    # number of rows per row or particle in use.
    rows |= {USED_GRABS: MOST_GRABS, PATCHES: MOST_GRABS * PATCH_ROWS, ALL_MOTORS: MOST_MOTORS}
    rows |= {USED_MOTORS: MOST_MOTORS, MOTOR_PARTICLES: 1, USED_JOINT_ROWS: 1, JOINT_ENDS: ENDS}
    whose = {MOTOR_PARTICLES: _OF_MOTORS, USED_JOINT_ROWS: _OF_JOINTS, JOINT_ENDS: _OF_JOINTS}
    kept = []
    for name, each, _ in state.fields:
        group = each.keep if state.is_kept(each) else each.native_keep
        if group:
            kept.append((*_plain(places[name]), rows[group], whose.get(group, _ALWAYS)))
    return {
        "fields/names": words(list(places)),
        "fields/places": np.array([_plain(each) for each in places.values()], dtype=np.int64),
        "fields/kept": np.array(kept, dtype=np.int64),
        "fields/image": image_of(state),
    }


def _plain(place: Any) -> tuple[int, ...]:
    assert place.kind in (FLOAT, WHOLE)
    return (place.offset, place.stride, place.count, place.width, place.kind)


def _of_asset(asset: SoftBodyAsset) -> Arrays:
    elements, stiffness = elements_of(asset.description)
    hull = asset.bound_hull
    return {
        "rest_rows": asset.rest_rows,
        "vertices": _floats(asset.mesh.vertices),
        "masses": _floats(asset.description.masses),
        "center": _floats(asset.center_of_mass),
        "pinned": _ints(asset.description.pinned),
        "outer": _ints(outer_vertices(asset.mesh)),
        "hull": _ints([] if hull is None else hull.vertices).ravel(),
        "hull_weights": _floats([] if hull is None else hull.weights).ravel(),
        "rank": _ints(asset.arrays.rank),
        "surface": _ints(asset.surface).reshape(-1, 3),
        "rigid": _floats(_rigid_row(asset.mesh)),
        "elements": _ints(elements),
        "element_stiffness": _floats(stiffness),
        "tets": _ints(asset.mesh.tets if elements.shape[1] == 2 else []).ravel(),
        "wave_speed": _floats([wave_speed(asset.description)]),
        "thickness": _floats([asset.surface_row[1]]),
        "friction": _floats([asset.contact.friction]),
        "filter": _ints(asset.contact.filter),
    }


def _rigid_row(mesh: BodyMesh) -> list[float]:
    """Return the longest extent and the radii of a rigid body [m]; nothing for other bodies."""
    if not isinstance(mesh, RigidMesh):
        return []
    return [float(np.ptp(mesh.points, axis=0).max()), *mesh.radii.tolist()]


def _held(context: WorldContext) -> Arrays:
    """Return the pinned vertices of the finest level for all slots, see `BodyRecord.held`."""
    bodies = context.slots.slots
    held = [None if body is None or body.level == 0 else record_of(body).held for body in bodies]
    rows = [np.zeros(0) if each is None else each for each in held]
    return {
        "levels/held_counts": _ints([len(each) for each in rows]),
        "levels/held": _ints(np.concatenate(rows)),
    }


def _of_mesh(mesh: ExportedMesh) -> Arrays:
    found = {
        "kind": _ints([mesh.asset, mesh.level, mesh.is_skin, mesh.vertex_count]),
        "triangles": _ints(mesh.triangles),
        "uv": mesh.uv,
        "is_serial": _ints([table.is_serial for table in mesh.tables]),
    }
    for level, table in enumerate(mesh.tables):
        found |= {f"ints{level}": table.ints, f"floats{level}": table.floats}
    return found


def _of_colliders(rows: Sequence[ColliderRow]) -> Arrays:
    return {
        "colliders/alive": _ints([row.is_alive for row in rows]),
        "colliders/sensor": _ints([row.is_sensor for row in rows]),
        "colliders/pose": _floats([[*row.position, *row.rotation] for row in rows]),
        "colliders/motion": _floats([[*row.velocity, *row.spin] for row in rows]),
        "colliders/target": _floats([_target_of(row) for row in rows]),
        "colliders/bounds": _floats([row.shape.bounds.ravel() for row in rows]),
        "colliders/skin": _floats([row.skin for row in rows]),
        "colliders/kind": _ints([row.shape.kind for row in rows]),
        "colliders/parameters": np.array([row.shape.parameters for row in rows]).astype(np.float32),
        "colliders/surface": _floats([(row.friction, row.restitution) for row in rows]),
        "colliders/surface_velocity": _floats([row.surface_velocity for row in rows]),
        "colliders/filter": _ints([(row.group, row.mask) for row in rows]),
        "colliders/seam": _floats([SEAM]),
    }


def _target_of(row: ColliderRow) -> list[float]:
    """Return 1 and the pose of a collider's target. If the collider has no target, all numbers are 0."""
    return [0.0] * 8 if row.target is None else [1.0, *np.concatenate(row.target).tolist()]


def _of_frames(context: WorldContext) -> Arrays:
    frames = context.of(Frames)
    return {
        "frames/alive": _ints([each is not None for each in frames.rows]),
        "frames/poses": np.stack([frames.present, frames.coming]).astype(np.float32),
        **_attached(context),
    }


def _attached(context: WorldContext) -> Arrays:
    """Return three arrays by name, with a number per particle: 1 if the load is recorded, else 0; the number
    of the attachment, from 1, or 0 if the particle is not attached; the force at which the attachment breaks
    [N], or 0 for never.
    """
    count = context.layout.particle_count
    feels, number = np.zeros(count, dtype=np.uint8), np.zeros(count, dtype=np.int32)
    breaks = np.zeros(count, dtype=np.float32)
    for body, held in context.of(Frames).attachments.items():
        for i, each in enumerate(held, start=1):
            rows = context.built.rows_of(body.index, each.particles)
            feels[rows], number[rows], breaks[rows] = each.two_way, i, each.break_force or 0.0
    return {"frames/feels": feels, "frames/attachment": number, "frames/break_force": breaks}


def _ints(numbers: Any) -> NDArray[np.int32]:
    return np.asarray(numbers).astype(np.int32)


def _floats(numbers: Any) -> NDArray[np.float64]:
    return np.asarray(numbers, dtype=np.float64)
