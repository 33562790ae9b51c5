"""A simulation taken out to a content pipeline: its meshes and their motion, in one file."""

from taichi_soft.bake.baking import BakeReport, bake
from taichi_soft.bake.room import Room

__all__ = ["BakeReport", "Room", "bake"]
