"""Solids that bodies collide with: their parameters, data for kernels, and surfaces to draw."""

from taichi_soft.contact.shapes.box import BoxShape
from taichi_soft.contact.shapes.capsule import CapsuleShape
from taichi_soft.contact.shapes.height_field import HeightFieldShape
from taichi_soft.contact.shapes.mesh import MeshShape
from taichi_soft.contact.shapes.plane import PlaneShape
from taichi_soft.contact.shapes.shape import Shape
from taichi_soft.contact.shapes.sphere import SphereShape

__all__ = ["BoxShape", "CapsuleShape", "HeightFieldShape", "MeshShape", "PlaneShape", "Shape", "SphereShape"]
