"""Colliders that are where nodes of the scene graph are."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from panda3d import bullet, core

from engine_adapter.panda3d.shapes import PlacedShape, shapes_of
from taichi_soft import Collider, OptionError, World


class NodeCollider:
    """One shape of a node as a collider. Made by `add_colliders`.

    Attributes:
        path: NodePath of the node.
        collider: that bodies hit.
    """

    def __init__(self, path: Any, placed: PlacedShape, collider: Collider) -> None:
        """Made by `add_colliders`."""
        self.path, self.collider = path, collider
        self._placed = placed

    def __repr__(self) -> str:
        return f"NodeCollider({self.path.get_name()!r}, {self.collider!r})"

    def follow(self) -> None:
        """Be where the node is at the end of the coming step, and push what is on the way there.

        Call it in `before_step`, after the node was moved to where it is when the step ends.
        Raises: StateError once the collider was removed.
        """
        self.collider.move_to(*self._placed.pose(self.path))

    def teleport(self) -> None:
        """Be where the node is at once, without pushing. Raises: StateError once the collider was removed."""
        self.collider.teleport(*self._placed.pose(self.path))


def add_colliders(
    world: World,
    path: Any,
    *,
    friction: float | None = None,
    restitution: float | None = None,
    thickness: float = 0.0,
) -> tuple[NodeCollider, ...]:
    """A collider for each collision solid and shape of Bullet at and below a node, where they are now.

    The world's coordinates are those of the top of the scene graph, such as `base.render`.
    Args:
        world: before `build`, or with `collider_room` for them.
        path: NodePath.
        friction: Coulomb coefficient. None: a node of Bullet has its own one, any other one 0.5.
        restitution, thickness: as in `World.add_collider`.
    Returns: the colliders, in the order of the nodes. Those that do not move need nothing more.
    Raises: as `shapes_of`, with nothing changed; OptionError where there is no shape at all; and as
        `World.add_collider`.
    """
    found = [(each, placed) for each in _nodes(path) for placed in shapes_of(each)]
    if not found:
        raise OptionError(f"there is no CollisionNode and no node of Bullet with shapes at or below {path}")
    made = []
    for each, placed in found:
        position, rotation = placed.pose(each)
        collider = world.add_collider(
            placed.shape,
            position=position,
            rotation=rotation,
            friction=_friction(each.node()) if friction is None else friction,
            restitution=restitution,
            thickness=thickness,
        )
        made.append(NodeCollider(each, placed, collider))
    return tuple(made)


def _nodes(path: Any) -> Iterator[Any]:
    """Paths to the node and what is below it, as far as they may carry shapes. Ghosts of Bullet do not."""
    if isinstance(path.node(), (core.CollisionNode, bullet.BulletRigidBodyNode)):
        yield path
    for child in path.get_children():
        yield from _nodes(child)


def _friction(node: Any) -> float:
    return float(node.get_friction()) if isinstance(node, bullet.BulletBodyNode) else 0.5
