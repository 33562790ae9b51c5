"""Surfaces from .glb and .gltf files."""

from taichi_soft.meshing.gltf.reader import read_gltf

__all__ = ["read_gltf"]
