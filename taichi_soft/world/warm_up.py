"""All that a game may do with a world, done once before the game begins, so that nothing compiles within it.

Taichi compiles a kernel where it is called first: a tenth of a second to one with an empty cache.
"""

from __future__ import annotations

import contextlib
import sys
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from taichi_soft.contact.shapes import SphereShape
from taichi_soft.control.drives import push_bodies
from taichi_soft.control.jumps import carry
from taichi_soft.core.constants import LANES
from taichi_soft.core.errors import StateError
from taichi_soft.elements.kernels.stress import read_stress
from taichi_soft.persistence.snapshot import restore_snapshot, take_snapshot
from taichi_soft.solver.substeps import FRAME
from taichi_soft.world.spawning import enter

if TYPE_CHECKING:
    from taichi_soft.world.body import Body
    from taichi_soft.world.world import World

SHORTEST = 1e-6
"""Step [s] in which nothing gets anywhere."""

UP = np.array([0.0, 0.0, 1.0])


def _say(what: str = "") -> None:
    """What is being compiled, on a line of a terminal that each call writes anew; nothing elsewhere."""
    if sys.stderr is not None and sys.stderr.isatty():
        told = f"compiling {what} (once; later starts find it in a cache)" if what else ""
        print(f"\r{told:<79}\r", end="", file=sys.stderr, flush=True)


def rehearse(world: World) -> None:
    """As `World.warm_up`."""
    _say("snapshots")
    before = take_snapshot(world)
    try:
        _say("the step")
        world._built.rehearse(SHORTEST)
        _say("what a game does to bodies")
        _fill_pools(world)
        bodies = [body for body in world.bodies if not body.is_frozen]
        world.set_wind((1.0, 0.0, 0.0))
        push_bodies([(body, np.ones_like(body.positions())) for body in bodies])
        world.apply_radial_impulse((0.0, 0.0, 0.0), 0.0, 1.0)
        for body in {body.asset: body for body in bodies}.values():
            _control(world, body, next((each for each in bodies if each is not body), None))
            _measure(world, body)
        _say("queries")
        _ask(world)
        _add_collider(world)
        world._built.rehearse(SHORTEST)
        for collider in world.colliders[:1]:
            _ = collider.impulse
    finally:
        restore_snapshot(world, before)
        _say()
    world.state_hash()
    if world.bodies and not world.settings.is_implicit:
        world.stable_substeps(FRAME)


def _fill_pools(world: World) -> None:
    """Let there be one body of every kind, and two in all, where there are slots for them."""
    living = {body.asset for body in world.bodies}
    for asset in world._pools.kinds:
        is_needed = asset not in living or len(world.bodies) < 2
        if is_needed and any(slot is None for slot in _slots_of(world, asset)):
            above = (world.settings.floor or 0.0) + float(np.abs(asset.mesh.vertices).max())
            enter(world, asset, asset.placed(above * UP, None, 0.0 * UP, 0.0 * UP, None))


def _slots_of(world: World, asset: object) -> list[Body | None]:
    pools = world._pools
    return [body for body, kind in zip(pools.slots, pools.assets, strict=True) if kind is asset]


def _add_collider(world: World) -> None:
    if world._built.colliders is not None:
        with contextlib.suppress(StateError):  # there is no room for it, nor will there be
            world.add_collider(SphereShape(1.0)).move_to((0.0, 0.0, 1.0))


def _control(world: World, body: Body, other: Body | None) -> None:
    """Push, set, pin and hold a body in every way."""
    place, free = body.center_of_mass(), np.setdiff1d(np.arange(body.vertex_count), body.pinned)
    body.apply_force(UP)
    body.apply_force(UP, free[:1])
    body.apply_impulse(0.0 * UP)
    body.apply_impulse_at_point(0.0 * UP, place, 1e6)
    body.set_velocity(0.0 * UP)
    body.set_gravity_scale(body.gravity_scale)
    body.set_linear_damping(0.1)
    body.set_sheltered(True)
    body.set_material(body.material)
    body.pin(free[:1])
    body.set_targets(free[:1], body.positions()[free[:1]])
    world._built.rehearse(SHORTEST)
    body.unpin(free[:1])
    _hold(world, body, other, free)
    if not body.is_held and not len(body.pinned):
        carry([body], np.eye(3), place, place + 100.0 * UP, keep=True)  # as `teleport`, whatever is there
    body.set_motion(body.positions(), body.velocities())


def _hold(world: World, body: Body, other: Body | None, free: NDArray[np.int64]) -> None:
    """Attach and grab a body, as far as there is anything free to hold it by."""
    if len(free):
        held = body.attach(free[:1], world.add_frame(), two_way=True)
        world._built.rehearse(SHORTEST)
        _ = held.force, held.torque
        held.release()
    with contextlib.suppress(StateError):  # all grabs are in use, which compiles them too
        grab = body.grab(0)
        grab.move(grab.point)
        _ = grab.force
        grab.release()
    has_joints = world._built.colliders is not None and not world.settings.is_implicit
    if other is not None and has_joints:
        joint = body.attach_to(other, [0], onto=[0])
        world._built.rehearse(SHORTEST)
        _ = joint.force, body.velocities()
        joint.release()


def _measure(world: World, body: Body) -> None:
    """Read all there is to read of a body."""
    state = world._built.state
    _ = body.positions(), body.velocities(), body.pinned
    read_stress(state, np.zeros(1, np.int32), np.zeros(1, np.float32), np.zeros((LANES, 5), np.float32))
    if body.asset.plasticity is not None:
        _ = body.plastic_strains


def _ask(world: World) -> None:
    """Ask every query."""
    far = np.array([0.0, 0.0, 1e4])
    world.raycast(far, -UP)
    for count in (1, 1000):  # few are traced by one thread, many by all
        world.raycasts(np.tile(far, (count, 1)), np.tile(-UP, (count, 1)))
    world.closest_point(far)
    world.overlap_sphere(far, 1.0)
    world.overlap_box(far, (1.0, 1.0, 1.0))
