"""Add bodies to a world and remove them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from taichi_soft.bodies.asset import Floats32, SoftBodyAsset
from taichi_soft.bodies.soft_body import belongs_to, present_asset, record_of, require_alive
from taichi_soft.contact.clearance import free_points, require_clear
from taichi_soft.contact.filters import filter_of
from taichi_soft.contact.overlap import Placed, require_apart
from taichi_soft.control.frictions import give_friction
from taichi_soft.control.material_constants import write_constants
from taichi_soft.core.checks import as_count, as_flag, as_rotation, as_vector
from taichi_soft.core.errors import OptionError, StateError
from taichi_soft.core.math.rotations import turned
from taichi_soft.core.serialisation import digest_of
from taichi_soft.core.types import Overlap, OverlapName
from taichi_soft.fracture.cutting import refill_slot, write_surface
from taichi_soft.fracture.tearing import Tears
from taichi_soft.solver.context import WorldContext
from taichi_soft.world.body import Body

MOST_VERTICES = 10_000_000
"""Largest number of vertices of a world. With more vertices, indices of element constants would need more
than 32 bits."""


def require_open(context: WorldContext) -> None:
    """Raise a StateError if the world is already built."""
    if context.fields is not None:
        raise StateError("the world is already built: add_body and reserve come first, then build() once")


def require_own(context: WorldContext, body: Any) -> None:
    """Raise an OptionError for a body of another world, and a StateError for a removed body."""
    if not isinstance(body, Body) or not belongs_to(body, context):
        raise OptionError(f"body must be a body of this world, got {body!r}")
    require_alive(body)


def add_body(
    context: WorldContext,
    new: SoftBodyAsset,
    position: ArrayLike,
    rotation: ArrayLike | None,
    velocity: ArrayLike,
    on_floor: bool,
    overlap: OverlapName,
    angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
) -> Body:
    """Implement `World.add_body`. If an asset equal to `new` was added before, the body uses that asset."""
    rule, key = Overlap.parse(overlap), _content(new)
    asset = context.slots.added.get(key, new)
    place = _place(context, asset, position, rotation, on_floor)
    rows = asset.placed(place, rotation, velocity, angular_velocity, context.settings.floor)
    _require_apart(context, asset, rows, rule)
    _add_slot(context, asset)
    context.slots.added[key] = asset
    return enter(context, asset, rows)


def _content(asset: SoftBodyAsset) -> tuple[Any, ...]:
    """Return a key that is equal for assets with equal options and the same mesh and material objects.

    Meshes and materials of rigid bodies are compared by value, because `add_rigid` makes them anew.
    """
    made_of = asset.description
    is_rigid = made_of.is_rigid
    return (
        digest_of(asset.mesh) if is_rigid else id(asset.mesh),
        asset.material if is_rigid else id(asset.material),
        made_of.model,
        made_of.pinned.tobytes(),
        asset.contact,
        asset.plasticity,
        asset.spare_vertices,
        asset.tearing,
        None if asset.hull is None else digest_of(asset.hull),
        *(_content(each) for each in asset.coarser),
    )


def reserve(context: WorldContext, asset: SoftBodyAsset, count: int) -> None:
    """Implement `World.reserve`."""
    require_open(context)
    _require_asset(asset)
    number = as_count(count, "count")
    vertices = context.layout.particle_count + number * (len(asset.mesh.vertices) + asset.spare_vertices)
    if vertices > MOST_VERTICES:
        raise OptionError(
            f"count is {number:,}: the world would have {vertices:,} vertices, at most {MOST_VERTICES:,}"
        )
    for _ in range(number):
        _add_slot(context, asset)


def spawn(
    context: WorldContext,
    asset: SoftBodyAsset,
    position: ArrayLike,
    rotation: ArrayLike | None,
    velocity: ArrayLike,
    angular_velocity: ArrayLike,
    on_floor: bool,
    overlap: OverlapName,
) -> Body:
    """Implement `World.spawn`."""
    _require_asset(asset)
    rule = Overlap.parse(overlap)
    context.slots.next_slot(asset)
    place = _place(context, asset, position, rotation, on_floor)
    rows = asset.placed(place, rotation, velocity, angular_velocity, context.settings.floor)
    if context.fields is not None:
        require_clear(context.colliders.handles, asset, free_points(asset, rows), "the body")
    _require_apart(context, asset, rows, rule)
    return enter(context, asset, rows)


def _place(
    context: WorldContext,
    asset: SoftBodyAsset,
    position: ArrayLike,
    rotation: ArrayLike | None,
    on_floor: bool,
) -> ArrayLike:
    """Return the position of the mesh's origin, (3,) [m].

    With `on_floor`, z of `position` is the height of the body's lowest point above the floor.

    Raises: OptionError for invalid values, and for `on_floor` in a world without a floor.
    """
    if not as_flag(on_floor, "on_floor"):
        return position
    floor = context.settings.floor
    if floor is None:
        raise OptionError(
            "on_floor is True, but the world has no floor: make it with World(floor=0.0), or omit on_floor"
        )
    x, y, z = as_vector(position, "position", "m")
    points = asset.touching_points(turned(asset.mesh.vertices, as_rotation(rotation)))
    return (x, y, z + floor + asset.radius - float(points[:, 2].min()))


def _require_apart(context: WorldContext, asset: SoftBodyAsset, rows: Floats32, rule: Overlap) -> None:
    """Raise an OptionError if `rule` forbids overlaps and a body in the state `rows` overlaps another."""
    if rule is Overlap.REFUSE and context.contact_with_another.soft:
        mesh, starts = asset.mesh, context.slots.starts
        others = (
            Placed(
                f"body {body.index}",
                present_asset(body),
                body.tets,
                body.surface,
                np.asarray(
                    body.positions() if context.fields else starts[body.index][:, :3], dtype=np.float64
                ),
                filter_of(body),
            )
            for body in context.slots.occupants
        )
        place = rows[:, :3].astype(np.float64)
        new = Placed("the body", asset, mesh.tets, mesh.surface, place, asset.contact.filter)
        require_apart(new, others)


def despawn(context: WorldContext, body: Body) -> None:
    """Implement `World.despawn`."""
    require_own(context, body)
    simulation = context.fields
    if simulation is not None:
        _release_all(context, body)
        simulation.wake_near(*simulation.box_of(body))  # wake bodies that can lie on the removed body
    context.slots.leave(body)
    record_of(body).removed_in = context.clock.steps
    if simulation is not None:
        simulation.empty(body.index)


def _release_all(context: WorldContext, body: Body) -> None:
    """Release all constraints of a body, and reset its material and friction, before its slot is emptied."""
    for each in context.slices:
        each.release_body(body)
    present = present_asset(body)
    if record_of(body).description is not present.description and not body.is_cut:
        context.built.change(body.index, write_constants, body, present.description)
    if record_of(body).friction is not None:
        give_friction(context.built.state, body, None)


def _require_asset(asset: Any) -> None:
    if not isinstance(asset, SoftBodyAsset):
        raise OptionError(f"asset must be a SoftBodyAsset, got {asset!r}")


def _add_slot(context: WorldContext, asset: SoftBodyAsset) -> None:
    context.layout.append(asset.arrays, asset.spare_vertices)
    context.slots.add_slot(asset)


def enter(context: WorldContext, asset: SoftBodyAsset, rows: Floats32) -> Body:
    """Add a body with the initial state `rows` in the next free slot."""
    slot, simulation = context.slots.next_slot(asset), context.fields
    if simulation is None:
        context.slots.starts[slot] = rows
    else:
        if context.layout.bodies[slot] is not asset.arrays:
            refill_slot(context, simulation.state, slot)
        else:  # the slot can contain data of a restored body that was cut or had another level
            write_surface(context, simulation.state, slot, asset)
        simulation.fill(slot, rows)
    return make_handle(context, asset)


def make_handle(context: WorldContext, asset: SoftBodyAsset) -> Body:
    """Make a handle for the next free slot of an asset."""
    body = Body(context, context.slots.next_slot(asset), asset)
    context.handles.enlist(body)
    context.slots.enter(body)
    context.of(Tears).watch(body)
    return body
