"""What bodies are made of: numbers only, no Taichi."""

from taichi_soft.materials.material import Material, require_material
from taichi_soft.materials.presets import PRESETS, preset

__all__ = ["PRESETS", "Material", "preset", "require_material"]
