"""Convert collision solids of Panda3D and shapes of Bullet to shapes of taichi-soft."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from panda3d import bullet, core

from taichi_soft import BoxShape, CapsuleShape, OptionError, PlaneShape, Shape, SphereShape

Floats = NDArray[np.float64]

_SCALE_TOLERANCE = 1e-3
"""Largest relative difference between the scales along a node's axes for which the scale counts as uniform.
The difference covers rounding in float32."""

_ADVICE = "build it from those, or add a shape with World.add_collider"


@dataclass(frozen=True, eq=False)
class PlacedShape:
    """A shape in the coordinates of its node, without the node's scale.

    Args:
        shape: shape of taichi-soft. Its size includes the node's scale.
        position: position of the shape's origin, (3,) [m].
        rotation: axes of the shape as columns, (3, 3).
    """

    shape: Shape
    position: Floats
    rotation: Floats

    def pose(self, path: Any) -> tuple[Floats, Floats]:
        """Return the position (3,) [m] and rotation (3, 3) of the shape in the world, for the node's current
        pose.

        Args:
            path: NodePath of the node.
        """
        place, turn = pose_of(path)
        return place + turn @ self.position, turn @ self.rotation


def shapes_of(path: Any) -> tuple[PlacedShape, ...]:
    """Convert the shapes of one CollisionNode or Bullet node, in order.

    Supported are CollisionSphere, CollisionBox, CollisionCapsule and CollisionPlane, at any uniform scale;
    and BulletSphereShape, BulletBoxShape, BulletCapsuleShape and BulletPlaneShape, unscaled.
    Args:
        path: NodePath to the node.
    Raises: OptionError for an unsupported solid or node, a non-uniform scale, a shear, or a scaled Bullet
        node.
    """
    node = path.node()
    if isinstance(node, core.CollisionNode):
        scale = _scale(path)
        return tuple(_of_solid(solid, scale, node) for solid in node.get_solids())
    if isinstance(node, bullet.BulletBodyNode):
        if abs(_scale(path) - 1.0) > _SCALE_TOLERANCE:
            raise OptionError(f"node {node.name!r} of Bullet is scaled: scale its shapes instead")
        return tuple(_of_bullet(node, number) for number in range(node.get_num_shapes()))
    raise OptionError(
        f"node {node.name!r} must be a CollisionNode or a node of Bullet, got {type(node).__name__}"
    )


def pose_of(path: Any) -> tuple[Floats, Floats]:
    """Return the position (3,) [m] and rotation (3, 3) of a node relative to the root of its scene graph."""
    transform = path.get_net_transform()
    return np.array(transform.get_pos(), dtype=np.float64), _matrix(transform.get_norm_quat())


def _matrix(quaternion: Any) -> Floats:
    """Return the rotation matrix of a quaternion, (3, 3). Its columns are the axes; in Panda3D, they are
    rows.
    """
    rows = core.LMatrix3()
    quaternion.extract_to_matrix(rows)
    turn: Floats = np.array([list(row) for row in rows.rows], dtype=np.float64).T
    return turn


def _scale(path: Any) -> float:
    """Return the uniform scale of a node. Raises: OptionError for a non-uniform scale or a shear."""
    transform = path.get_net_transform()
    scale = np.array(transform.get_scale(), dtype=np.float64)
    spread = float(np.ptp(scale))
    shear = float(np.abs(np.array(transform.get_shear())).max())
    if scale.min() <= 0.0 or max(spread, shear) > _SCALE_TOLERANCE * scale.max():
        raise OptionError(
            f"node {path.node().name!r} must have one scale above 0 along all axes and no shear, got scale "
            f"{scale.tolist()} and shear {list(transform.get_shear())}"
        )
    return float(scale.mean())


def _of_solid(solid: Any, scale: float, node: Any) -> PlacedShape:
    make = _SOLIDS.get(type(solid))
    if make is None:
        raise _refused(solid, node, _SOLIDS)
    return make(solid, scale)


def _of_bullet(node: Any, number: int) -> PlacedShape:
    shape, place = node.get_shape(number), node.get_shape_transform(number)
    make = _BULLET.get(type(shape))
    if make is None:
        raise _refused(shape, node, _BULLET)
    made = make(shape)
    turn = _matrix(place.get_norm_quat())
    position = np.array(place.get_pos(), dtype=np.float64) + turn @ made.position
    return PlacedShape(made.shape, position, turn @ made.rotation)


def _refused(shape: Any, node: Any, known: dict[Any, Any]) -> OptionError:
    kinds = ", ".join(kind.__name__ for kind in known)
    return OptionError(f"{type(shape).__name__} of node {node.name!r} is not one of {kinds}: {_ADVICE}")


def _at(shape: Shape, position: Any, rotation: Floats | None = None) -> PlacedShape:
    return PlacedShape(
        shape, np.array(position, dtype=np.float64), np.eye(3) if rotation is None else rotation
    )


def _onto(axis: Floats) -> Floats:
    """Return a rotation (3, 3) that maps the z axis to a unit vector (3,)."""
    across = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    across /= np.linalg.norm(across)
    turn: Floats = np.array([across, np.cross(axis, across), axis]).T
    return turn


def _sphere(solid: Any, scale: float) -> PlacedShape:
    return _at(SphereShape(scale * solid.get_radius()), scale * np.array(solid.get_center()))


def _box(solid: Any, scale: float) -> PlacedShape:
    lower, upper = np.array(solid.get_min(), dtype=np.float64), np.array(solid.get_max(), dtype=np.float64)
    return _at(BoxShape(scale * (upper - lower)), scale * (lower + upper) / 2)


def _capsule(solid: Any, scale: float) -> PlacedShape:
    ends = np.array([list(solid.get_point_a()), list(solid.get_point_b())], dtype=np.float64)
    way = ends[1] - ends[0]
    length = float(np.linalg.norm(way))
    rotation = _onto(way / length) if length > 0.0 else None
    shape = CapsuleShape(scale * solid.get_radius(), scale * length)
    return _at(shape, scale * ends.mean(axis=0), rotation)


def _plane(solid: Any, scale: float) -> PlacedShape:
    normal = np.array(solid.get_plane().get_normal(), dtype=np.float64)
    length = float(np.linalg.norm(normal))
    offset = solid.get_plane()[3] / length  # the plane is n x + offset = 0
    return _at(PlaneShape(normal), -scale * offset * normal / length)


def _bullet_sphere(shape: Any) -> PlacedShape:
    return _at(SphereShape(shape.get_radius()), (0, 0, 0))


def _bullet_box(shape: Any) -> PlacedShape:
    return _at(BoxShape(2 * np.array(shape.get_half_extents_with_margin(), dtype=np.float64)), (0, 0, 0))


def _bullet_capsule(shape: Any) -> PlacedShape:
    """Convert a capsule. Panda3D does not expose the axis of a capsule, but its moment of inertia is smallest
    about that axis.
    """
    probe = bullet.BulletRigidBodyNode()
    probe.add_shape(shape)
    probe.set_mass(1.0)
    axis = np.eye(3)[int(np.argmin(list(probe.get_inertia())))]
    length = 2 * shape.get_half_height()
    return _at(CapsuleShape(shape.get_radius(), length), (0, 0, 0), _onto(axis))


def _bullet_plane(shape: Any) -> PlacedShape:
    normal = np.array(shape.get_plane_normal(), dtype=np.float64)
    normal /= math.sqrt(float(normal @ normal))
    return _at(PlaneShape(normal), shape.get_plane_constant() * normal)


_SOLIDS: dict[Any, Callable[[Any, float], PlacedShape]] = {
    core.CollisionSphere: _sphere,
    core.CollisionBox: _box,
    core.CollisionCapsule: _capsule,
    core.CollisionPlane: _plane,
}
"""Converter for each class of solids. Subclasses are not converted, because they can have other shapes:
CollisionPolygon is a subclass of CollisionPlane, and hollow solids are subclasses of spheres."""

_BULLET: dict[Any, Callable[[Any], PlacedShape]] = {
    bullet.BulletSphereShape: _bullet_sphere,
    bullet.BulletBoxShape: _bullet_box,
    bullet.BulletCapsuleShape: _bullet_capsule,
    bullet.BulletPlaneShape: _bullet_plane,
}
