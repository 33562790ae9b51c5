"""Bodies that come into a world and leave it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from taichi_soft.bodies.asset import Floats32, SoftBodyAsset
from taichi_soft.contact.clearance import free_points, require_clear
from taichi_soft.control.materials import set_material
from taichi_soft.core.checks import as_count
from taichi_soft.core.errors import OptionError, StateError
from taichi_soft.fracture.cutting import refill_slot
from taichi_soft.world.body import Body

if TYPE_CHECKING:
    from taichi_soft.world.world import World

MOST_VERTICES = 10_000_000
"""In a world: the constants of the tetrahedra between more would not be counted in 32 bits."""


def require_open(world: World) -> None:
    """Raises: StateError after `World.build`."""
    if world.is_built:
        raise StateError("the world is already built: add_body and reserve come first, then build() once")


def require_own(world: World, body: Any) -> None:
    """Raises: OptionError for what is no body of this world; StateError for one that was removed."""
    if not isinstance(body, Body) or body._world_ref() is not world:
        raise OptionError(f"body must be one that this world made, got {body!r}")
    body._require_alive()


def add_body(
    world: World, new: SoftBodyAsset, position: ArrayLike, rotation: ArrayLike | None, velocity: ArrayLike
) -> Body:
    """As `World.add_body`, of an asset made for it; copies share the first one."""
    key = _content(new)
    asset = world._pools.added.get(key, new)
    asset.description.model.require_integrator(world.settings.integrator)
    rows = asset.placed(position, rotation, velocity, (0.0, 0.0, 0.0), world.settings.floor)
    _add_slot(world, asset)
    world._pools.added[key] = asset
    return enter(world, asset, rows)


def _content(asset: SoftBodyAsset) -> tuple[Any, ...]:
    """What an asset is made of: the same for copies, as long as one of them is there."""
    made_of = asset.description
    return (
        id(asset.mesh),
        id(asset.material),
        made_of.model,
        made_of.pinned.tobytes(),
        asset.contact,
        asset.plasticity,
        asset.spare_vertices,
        asset.tearing,
    )


def reserve(world: World, asset: SoftBodyAsset, count: int) -> None:
    """As `World.reserve`."""
    require_open(world)
    _require_asset(asset)
    number = as_count(count, "count")
    asset.description.model.require_integrator(world.settings.integrator)
    vertices = world._scene.particle_count + number * (len(asset.mesh.vertices) + asset.spare_vertices)
    if vertices > MOST_VERTICES:
        raise OptionError(
            f"count is {number:,}: the world would hold {vertices:,} vertices, at most {MOST_VERTICES:,}"
        )
    for _ in range(number):
        _add_slot(world, asset)


def spawn(
    world: World,
    asset: SoftBodyAsset,
    position: ArrayLike,
    rotation: ArrayLike | None,
    velocity: ArrayLike,
    angular_velocity: ArrayLike,
) -> Body:
    """As `World.spawn`."""
    _require_asset(asset)
    world._pools.next_slot(asset)
    rows = asset.placed(position, rotation, velocity, angular_velocity, world.settings.floor)
    if world.is_built:
        require_clear(world.colliders, asset, free_points(asset, rows), "the body")
    return enter(world, asset, rows)


def despawn(world: World, body: Body) -> None:
    """As `World.despawn`."""
    require_own(world, body)
    simulation = world._simulation
    if simulation is not None:
        _let_go(world, body)
        simulation.wake_near(*simulation.box_of(body))  # what may have lain on it
    world._pools.leave(body)
    body._removed_in = world.step_count
    if simulation is not None:
        simulation.empty(body.index)


def _let_go(world: World, body: Body) -> None:
    """Give up what is tied to a body, and a material that it was given, before its slot is emptied."""
    for attachment in list(body._attachments):
        attachment.release()
    for grab in [each for each in world._grabs.values() if each.body is body]:
        grab.release()
    for joint in body._joints:
        joint.release()
    if body._description is not body.asset.description and not body.is_cut:
        set_material(body, body.asset.material)


def _require_asset(asset: Any) -> None:
    if not isinstance(asset, SoftBodyAsset):
        raise OptionError(f"asset must be a SoftBodyAsset, got {asset!r}")


def _add_slot(world: World, asset: SoftBodyAsset) -> None:
    world._scene.append(asset.arrays, asset.spare_vertices)
    world._pools.add_slot(asset)


def enter(world: World, asset: SoftBodyAsset, rows: Floats32) -> Body:
    """A new body in the next free slot, which begins as `rows` say."""
    slot, simulation = world._pools.next_slot(asset), world._simulation
    if simulation is None:
        world._pools.starts[slot] = rows
    else:
        if world._scene.bodies[slot] is not asset.arrays:
            refill_slot(world, simulation.state, slot)
        simulation.fill(slot, rows)
    return take_in(world, asset)


def take_in(world: World, asset: SoftBodyAsset) -> Body:
    """A handle to what is in the next free slot of an asset."""
    body = Body(world, world._pools.next_slot(asset), asset)
    world._handles.enlist(body)
    world._pools.enter(body)
    simulation = world._simulation
    if simulation is not None and simulation.tears is not None:
        simulation.tears.watch(body)
    return body
