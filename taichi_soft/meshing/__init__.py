"""Meshes of bodies at rest, built-in shapes, mesh files and measures of mesh quality."""

from taichi_soft.meshing.body_mesh import BodyMesh
from taichi_soft.meshing.delaunay import delaunay_mesh
from taichi_soft.meshing.io import load_mesh, save_mesh
from taichi_soft.meshing.lattices import cloth, cloth_constants, edges_as_particles, rope
from taichi_soft.meshing.ordering import edge_owners, renumbered, spatial_order, tet_order
from taichi_soft.meshing.particle_mesh import ParticleMesh
from taichi_soft.meshing.quality import MeshQuality
from taichi_soft.meshing.rings import EdgeRings
from taichi_soft.meshing.rod_mesh import RodMesh, rod
from taichi_soft.meshing.shapes import beam, box, cylinder, extrude, sphere, torus, voxels
from taichi_soft.meshing.shell_mesh import ShellMesh, sheet
from taichi_soft.meshing.surface_mesh import surface_mesh
from taichi_soft.meshing.tet_mesh import TetMesh
from taichi_soft.meshing.voronoi import VoronoiGraph, voronoi_graph

__all__ = [
    "BodyMesh",
    "EdgeRings",
    "MeshQuality",
    "ParticleMesh",
    "RodMesh",
    "ShellMesh",
    "TetMesh",
    "VoronoiGraph",
    "beam",
    "box",
    "cloth",
    "cloth_constants",
    "cylinder",
    "delaunay_mesh",
    "edge_owners",
    "edges_as_particles",
    "extrude",
    "load_mesh",
    "renumbered",
    "rod",
    "rope",
    "save_mesh",
    "sheet",
    "spatial_order",
    "sphere",
    "surface_mesh",
    "tet_order",
    "torus",
    "voronoi_graph",
    "voxels",
]
