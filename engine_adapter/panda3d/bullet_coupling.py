"""Two-way coupling of Bullet's rigid bodies and soft bodies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from panda3d import bullet, core

from engine_adapter.panda3d.node_colliders import NodeCollider, add_colliders
from engine_adapter.panda3d.shapes import pose_of
from taichi_soft import OptionError, World

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class BulletState:
    """Poses and velocities of rigid bodies. Returned by `BulletCoupling.snapshot`."""

    rows: tuple[tuple[Any, ...], ...]  # state of each rigid body


class _Rigid:
    """A rigid body, and the colliders of its shapes."""

    def __init__(self, path: Any, colliders: tuple[NodeCollider, ...]) -> None:
        self.path, self.colliders = path, colliders
        self.last: Floats = np.zeros((2, 3))  # impulse [N s] and angular impulse [N m s] in the last step

    @property
    def is_pushed(self) -> bool:
        node = self.path.node()
        return bool(node.get_mass() > 0.0 and not node.is_kinematic())

    def push(self) -> None:
        """Apply to Bullet's body the impulses that its colliders received in the last step."""
        now = self._impulses()
        if self.is_pushed:
            # Bullet receives impulses one step late. To predict the next impulse, add half of the current
            # impulse now and subtract it in the next step. Otherwise the coupled bodies would gain energy.
            linear, angular = 1.5 * now - 0.5 * self.last
            node = self.path.node()
            if linear.any() or angular.any():
                node.set_active(True)  # a sleeping body ignores impulses
                node.apply_central_impulse(core.LVector3(*linear))
                node.apply_torque_impulse(core.LVector3(*angular))
        self.last = now

    def _impulses(self) -> Floats:
        """Return the sum of the impulses and angular impulses on the colliders, about the body's origin,
        (2, 3).
        """
        total = np.zeros((2, 3))
        for each in self.colliders:
            collider = each.collider
            impulse = collider.impulse
            arm = collider.position - pose_of(self.path)[0]
            total += np.array([impulse, collider.angular_impulse + np.cross(arm, impulse)])
        return total


class BulletCoupling:
    """Steps a world of Bullet together with a soft world, with two-way coupling.

        coupling = BulletCoupling(world, bullet_world)
        coupling.add(crate)
        world.build()
        step = FixedStep(dt=1 / 60)
        adapter = EngineAdapter(world, step, before_step=lambda world: coupling.step(step.dt))

    A rigid body must be heavier than the soft vertices that it touches, see the table in docs/coupling.md.

    Args:
        world: world of the soft bodies.
        bullet_world: a BulletWorld. No other code must step this world.
    Raises: OptionError for other arguments.
    """

    def __init__(self, world: World, bullet_world: Any) -> None:
        if not isinstance(world, World):
            raise OptionError(f"world must be a taichi_soft.World, got {type(world).__name__}")
        if not isinstance(bullet_world, bullet.BulletWorld):
            raise OptionError(f"bullet_world must be a BulletWorld, got {type(bullet_world).__name__}")
        self._world, self._bullet = world, bullet_world
        self._rigid: list[_Rigid] = []

    def add(
        self,
        path: Any,
        *,
        friction: float | None = None,
        restitution: float | None = None,
        thickness: float = 0.0,
    ) -> tuple[NodeCollider, ...]:
        """Couple a rigid body to the soft bodies. Soft bodies do not move a static or kinematic body.

        Args:
            path: NodePath of a BulletRigidBodyNode that is attached to the Bullet world.
            friction, restitution, thickness: see `add_colliders`.
        Returns: the colliders of the body's shapes.
        Raises: as `add_colliders`; OptionError if the node is of another type or was already added.
        """
        node = path.node()
        if not isinstance(node, bullet.BulletRigidBodyNode):
            raise OptionError(f"node {node.name!r} must be a BulletRigidBodyNode, got {type(node).__name__}")
        if any(each.path == path for each in self._rigid):
            raise OptionError(f"node {node.name!r} was already added")
        colliders = add_colliders(
            self._world, path, friction=friction, restitution=restitution, thickness=thickness
        )
        self._rigid.append(_Rigid(path, colliders))
        return colliders

    def remove(self, path: Any) -> None:
        """Remove the colliders of a rigid body.

        Args:
            path: node path that was passed to `add`.
        Raises: OptionError for a body that was not added.
        """
        for each in self._rigid:
            if each.path == path:
                for one in each.colliders:
                    one.collider.remove()
                self._rigid.remove(each)
                return
        raise OptionError(f"node {path.get_name()!r} was not added")

    def step(self, dt: float) -> None:
        """Step Bullet by `dt` [s]. Call this in `before_step`.

        Before Bullet's step, the rigid bodies receive the impulses that soft bodies exerted on them in the
        last soft step. After Bullet's step, the colliders move to the new poses of their rigid bodies.
        Args:
            dt: length of the step [s].
        """
        for each in self._rigid:
            each.push()
        # With substeps, Bullet would report poses one step late, and contacts at late poses would add energy.
        self._bullet.do_physics(dt, 0)
        for each in self._rigid:
            for one in each.colliders:
                one.follow()

    def snapshot(self) -> BulletState:
        """Return the poses and velocities of the rigid bodies. Call this together with `World.snapshot`.

        The result does not contain Bullet's contact cache. A restored run therefore looks the same but is not
        bit-identical.
        """
        rows = []
        for each in self._rigid:
            node = each.path.node()
            motion = (core.LVector3(node.get_linear_velocity()), core.LVector3(node.get_angular_velocity()))
            rows.append((each.path, each.path.get_transform(), *motion, each.last.copy()))
        return BulletState(tuple(rows))

    def restore(self, state: BulletState) -> None:
        """Restore the rigid bodies. Call this after `World.restore`, which restores their colliders.

        Args:
            state: result of `snapshot`.
        Raises: OptionError if rigid bodies have been added or removed since the snapshot, with nothing
            changed.
        """
        if [row[0] for row in state.rows] != [each.path for each in self._rigid]:
            raise OptionError(
                "rigid bodies were added or removed since the snapshot: restore the same set first"
            )
        for each, (path, transform, linear, angular, last) in zip(self._rigid, state.rows, strict=True):
            node = path.node()
            path.set_transform(transform)
            node.clear_forces()
            node.set_linear_velocity(linear)
            node.set_angular_velocity(angular)
            node.set_active(True)
            each.last = last.copy()
