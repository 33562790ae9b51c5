"""Materials of bodies: constants only, independent of Taichi."""

from taichi_soft.elements.materials.anisotropic import AnisotropicMaterial, frames_along
from taichi_soft.elements.materials.material import CONSTANTS, Material, isotropic_stiffness
from taichi_soft.elements.materials.presets import PRESETS, preset
from taichi_soft.elements.materials.rigid import RigidMaterial
from taichi_soft.elements.materials.rod_material import RodMaterial
from taichi_soft.elements.materials.shell_material import ShellMaterial
from taichi_soft.elements.materials.spring_constants import SpringMaterial
from taichi_soft.elements.materials.stiffness import Stiffness, voigt_stress

AnyMaterial = Material | AnisotropicMaterial | RigidMaterial | RodMaterial | ShellMaterial | SpringMaterial
"""Material of any kind."""

__all__ = [
    "CONSTANTS",
    "PRESETS",
    "AnisotropicMaterial",
    "AnyMaterial",
    "Material",
    "RigidMaterial",
    "RodMaterial",
    "ShellMaterial",
    "SpringMaterial",
    "Stiffness",
    "frames_along",
    "isotropic_stiffness",
    "preset",
    "voigt_stress",
]
