"""Bake a simulation into a file of meshes and their motion, for a content pipeline."""

from taichi_soft.bake.baking import BakeReport, bake
from taichi_soft.bake.room import Room

__all__ = ["BakeReport", "Room", "bake"]
