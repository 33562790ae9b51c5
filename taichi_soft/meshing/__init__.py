"""Bodies at rest: particles, edges and tetrahedra, where they come from and how good they are."""

from taichi_soft.meshing.body_mesh import BodyMesh
from taichi_soft.meshing.io import load_mesh, save_mesh
from taichi_soft.meshing.ordering import renumbered, spatial_order, tet_order
from taichi_soft.meshing.particle_mesh import ParticleMesh
from taichi_soft.meshing.quality import MeshQuality
from taichi_soft.meshing.shapes import beam, box, cylinder, extrude, sphere, torus, voxels
from taichi_soft.meshing.surface_mesh import surface_mesh
from taichi_soft.meshing.tet_mesh import TetMesh

__all__ = [
    "BodyMesh",
    "MeshQuality",
    "ParticleMesh",
    "TetMesh",
    "beam",
    "box",
    "cylinder",
    "extrude",
    "load_mesh",
    "renumbered",
    "save_mesh",
    "spatial_order",
    "sphere",
    "surface_mesh",
    "tet_order",
    "torus",
    "voxels",
]
