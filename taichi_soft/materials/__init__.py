"""What bodies are made of: numbers only, no Taichi."""

from taichi_soft.materials.material import CONSTANTS, Material, require_material
from taichi_soft.materials.presets import PRESETS, preset
from taichi_soft.materials.springs import SpringMaterial
from taichi_soft.materials.stiffness import Stiffness

__all__ = ["CONSTANTS", "PRESETS", "Material", "SpringMaterial", "Stiffness", "preset", "require_material"]
