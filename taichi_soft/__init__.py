"""Real-time soft bodies from real material parameters."""

from taichi_soft.body import Body, Failure
from taichi_soft.errors import (
    DeviceError,
    FrozenBodyWarning,
    MaterialError,
    MeshError,
    OptionError,
    StateError,
    TaichiSoftError,
    UnstableStepWarning,
    VideoError,
)
from taichi_soft.forces import internal_forces
from taichi_soft.integrators import StableStep, stable_step
from taichi_soft.laws import LAWS, element_model
from taichi_soft.materials import PRESETS, Material, preset
from taichi_soft.meshing import (
    MeshQuality,
    ParticleMesh,
    TetMesh,
    beam,
    box,
    cylinder,
    extrude,
    load_mesh,
    save_mesh,
    sphere,
    surface_mesh,
    torus,
    voxels,
)
from taichi_soft.runtime import Device, device, init
from taichi_soft.settings import Settings
from taichi_soft.world import World

__all__ = [
    "LAWS",
    "PRESETS",
    "Body",
    "Device",
    "DeviceError",
    "Failure",
    "FrozenBodyWarning",
    "Material",
    "MaterialError",
    "MeshError",
    "MeshQuality",
    "OptionError",
    "ParticleMesh",
    "Settings",
    "StableStep",
    "StateError",
    "TaichiSoftError",
    "TetMesh",
    "UnstableStepWarning",
    "VideoError",
    "World",
    "beam",
    "box",
    "cylinder",
    "device",
    "element_model",
    "extrude",
    "init",
    "internal_forces",
    "load_mesh",
    "preset",
    "save_mesh",
    "sphere",
    "stable_step",
    "surface_mesh",
    "torus",
    "voxels",
]
