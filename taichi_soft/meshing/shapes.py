"""Built-in bodies of well-shaped tetrahedra. They need no external mesher and are equal on every machine."""

from taichi_soft.meshing.grid_shapes import beam, box, voxels
from taichi_soft.meshing.prism_shapes import cylinder, extrude, torus
from taichi_soft.meshing.sphere_shape import sphere

__all__ = ["beam", "box", "cylinder", "extrude", "sphere", "torus", "voxels"]
