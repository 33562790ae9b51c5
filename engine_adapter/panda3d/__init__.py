"""Panda3D integration: nodes that draw soft bodies, a task that steps them, colliders and rigid bodies."""

from taichi_soft.core.extras import require_extra

require_extra("panda3d", "engine_adapter.panda3d needs")

# isort: split
from engine_adapter.panda3d.bullet_coupling import BulletCoupling, BulletState  # noqa: E402
from engine_adapter.panda3d.debug_node import DebugNode  # noqa: E402
from engine_adapter.panda3d.mouse_grab import MouseGrab  # noqa: E402
from engine_adapter.panda3d.node_colliders import NodeCollider, add_colliders  # noqa: E402
from engine_adapter.panda3d.shapes import PlacedShape, shapes_of  # noqa: E402
from engine_adapter.panda3d.soft_body_node import SoftBodyNode  # noqa: E402
from engine_adapter.panda3d.soft_body_task import SoftBodyTask  # noqa: E402

__all__ = [
    "BulletCoupling",
    "BulletState",
    "DebugNode",
    "MouseGrab",
    "NodeCollider",
    "PlacedShape",
    "SoftBodyNode",
    "SoftBodyTask",
    "add_colliders",
    "shapes_of",
]
