"""Kernels that the native library calls, with the arguments for which they are compiled."""

from __future__ import annotations

from collections.abc import Sequence
from inspect import signature
from typing import Any

from taichi_soft.bodies.kernels.readout import read_positions
from taichi_soft.contact.kernels.collider_rows import forget_collider, sum_collider_impulses
from taichi_soft.contact.kernels.parting import mark_placed
from taichi_soft.contact.kernels.sensors import find_bodies_inside
from taichi_soft.contact.kernels.touches import read_touches
from taichi_soft.control.kernels.drives import add_push
from taichi_soft.control.kernels.embedding import embed_points
from taichi_soft.control.kernels.grab_patch import shape_patch
from taichi_soft.control.kernels.impulses import add_impulse_near, add_radial_impulse, add_velocity
from taichi_soft.control.kernels.joints import end_joint, forget_held, write_joint
from taichi_soft.control.kernels.motors import find_rest_axis, read_speed
from taichi_soft.control.kernels.origin import shift_places
from taichi_soft.control.kernels.pins import aim_pinned, free_particles, pin_particles, write_targets
from taichi_soft.control.kernels.rigid_motion import jump, write_rigid_velocity
from taichi_soft.core.runtime import ti
from taichi_soft.export.kernels.root import read_root
from taichi_soft.export.meshes import ExportedMesh
from taichi_soft.fracture.kernels.topology import (
    read_motion,
    write_body,
    write_contact_edges,
    write_kind,
    write_touching,
)
from taichi_soft.levels.kernels.map_motion import map_motion
from taichi_soft.queries.kernels.bodies import find_closest, find_hits, find_overlaps
from taichi_soft.queries.kernels.casts import cast_on_bodies
from taichi_soft.queries.kernels.colliders import cast_on_colliders, closest_on_colliders
from taichi_soft.solver.context import WorldContext
from taichi_soft.solver.kernels.islands import list_joined_islands
from taichi_soft.solver.kernels.sleep import wake_body, wake_near
from taichi_soft.solver.kernels.spawn import despawn_body, disable_body, enable_body, spawn_body
from taichi_soft.solver.kernels.step import step_islands

Kernels = dict[str, tuple[Any, dict[str, Any]]]

_SERIAL = {
    "aim_pinned": aim_pinned,
    "spawn_body": spawn_body,
    "despawn_body": despawn_body,
    "write_rigid_velocity": write_rigid_velocity,
    "jump": jump,
    "add_velocity": add_velocity,
    "add_impulse_near": add_impulse_near,
    "add_radial_impulse": add_radial_impulse,
    "add_push": add_push,
    "pin_particles": pin_particles,
    "free_particles": free_particles,
    "write_targets": write_targets,
    "read_positions": read_positions,
    "find_closest": find_closest,
    "find_overlaps": find_overlaps,
    "cast_on_bodies": cast_on_bodies,
    "read_touches": read_touches,
    "find_bodies_inside": find_bodies_inside,
    "shift_places": shift_places,
    "read_root": read_root,
}
"""Kernels that every world needs, by name."""

_OF_CONTACT = {
    "write_joint": write_joint,
    "end_joint": end_joint,
    "disable_body": disable_body,
    "enable_body": enable_body,
    "forget_held": forget_held,
    "read_speed": read_speed,
    "closest_on_colliders": closest_on_colliders,
}
"""Kernels of joints, motors, colliders and bodies that are switched off. These need a world with contact."""

_OF_LEVELS = {"read_motion": read_motion, "write_body": write_body, "write_kind": write_kind}
"""Kernels that change the level of detail of a body."""


def kernels_of(context: WorldContext, meshes: Sequence[ExportedMesh]) -> Kernels:
    """Return all kernels that the native library calls in a world, by name, with their arguments."""
    state, program = context.built.state, context.built.program
    found = {name: _example(kernel, state=state) for name, kernel in _SERIAL.items()}
    found["step"] = _example(step_islands, state=state, program=program)
    found["shape_patch"] = _example(shape_patch)
    found["embed_points"] = _example(embed_points)
    found["find_rest_axis"] = _example(find_rest_axis)
    found["forget_collider"] = _example(forget_collider, colliders=state.colliders)
    found["sum_collider_impulses"] = _example(sum_collider_impulses, colliders=state.colliders)
    found |= {name: _example(kernel, state=state) for name, kernel in _OF_CONTACT.items()}
    if not program.has_soft_contact:
        found["list_joined_islands"] = _example(list_joined_islands, state=state)
    found["find_hits"] = _example(find_hits, state=state, is_serial=True)
    if program.has_soft_contact:
        found["mark_placed"] = _example(mark_placed, state=state)
    found["cast_on_colliders"] = _example(cast_on_colliders, state=state, is_serial=True)
    if context.built.sleeps:
        found["wake_body"] = _example(wake_body, state=state)
        found["wake_near"] = _example(wake_near, state=state)
    if any(asset.coarser for asset in context.slots.kinds):
        found |= {name: _example(kernel, state=state) for name, kernel in _OF_LEVELS.items()}
        found["map_motion"] = _example(map_motion)
        if program.has_soft_contact:
            found["write_contact_edges"] = _example(write_contact_edges, state=state)
        if state.capacity.contact.hull:
            found["write_touching"] = _example(write_touching, state=state)
    for table in (table for mesh in meshes for table in mesh.tables):
        name, kernel = table.kernel
        found[name] = _example(kernel, state=state, is_serial=table.is_serial)
    return found


def _example(kernel: Any, **templates: Any) -> tuple[Any, dict[str, Any]]:
    """Return a kernel with its template arguments, and an example of each array argument."""
    arguments = dict(templates)
    for name, parameter in signature(kernel).parameters.items():
        kind = parameter.annotation
        if isinstance(kind, ti.types.ndarray_type.NdarrayType):
            arguments[name] = ti.ndarray(kind.dtype, (1,) * kind.ndim)
    return kernel, arguments
