"""Colliders that follow nodes of the scene graph."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from panda3d import bullet, core

from engine_adapter.panda3d.shapes import PlacedShape, shapes_of
from taichi_soft import Collider, OptionError, World


class NodeCollider:
    """A collider for one shape of a node. Returned by `add_colliders`.

    Attributes:
        path: NodePath of the node.
        collider: collider of the shape.
    """

    def __init__(self, path: Any, placed: PlacedShape, collider: Collider) -> None:
        """Use `add_colliders` instead."""
        self.path, self.collider = path, collider
        self._placed = placed

    def __repr__(self) -> str:
        return f"NodeCollider({self.path.get_name()!r}, {self.collider!r})"

    def follow(self) -> None:
        """Move the collider to the node's pose during the next step. The collider pushes bodies in its path.

        Call this in `before_step`, after setting the pose that the node has at the end of the step.
        Raises: StateError after the collider was removed.
        """
        self.collider.move_to(*self._placed.pose(self.path))

    def teleport(self) -> None:
        """Move the collider to the node's pose at once, without pushing bodies. Raises: StateError after the
        collider was removed.
        """
        self.collider.teleport(*self._placed.pose(self.path))


def add_colliders(
    world: World,
    path: Any,
    *,
    friction: float | None = None,
    restitution: float | None = None,
    thickness: float = 0.0,
) -> tuple[NodeCollider, ...]:
    """Add a collider for each collision solid and Bullet shape of a node and its descendants, at their
    current poses.

    World coordinates are those of the root of the scene graph, such as `base.render`.
    Args:
        world: world before `build`, or with enough `collider_room`.
        path: NodePath of the node.
        friction: Coulomb coefficient. None uses the friction of a Bullet node, and 0.5 for other nodes.
        restitution, thickness: see `World.add_collider`.
    Returns: the colliders, in the order of the nodes. Static colliders need no further calls.
    Raises: as `shapes_of`, with nothing changed; OptionError if there is no shape; as `World.add_collider`.
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
    """Yield the paths of the node and its descendants that can have shapes, except Bullet's ghosts."""
    if isinstance(path.node(), (core.CollisionNode, bullet.BulletRigidBodyNode)):
        yield path
    for child in path.get_children():
        yield from _nodes(child)


def _friction(node: Any) -> float:
    return float(node.get_friction()) if isinstance(node, bullet.BulletBodyNode) else 0.5
