"""What bodies are made of: numbers only, no Taichi."""

from taichi_soft.materials.material import Material, require_material
from taichi_soft.materials.presets import PRESETS, preset
from taichi_soft.materials.stiffness import Stiffness

__all__ = ["PRESETS", "Material", "Stiffness", "preset", "require_material"]
