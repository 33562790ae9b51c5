"""Surfaces from .glb and .gltf files."""

from taichi_soft.meshing.gltf.reader import Part, read_gltf

__all__ = ["Part", "read_gltf"]
