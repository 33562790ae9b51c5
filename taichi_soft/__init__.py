"""Real-time soft bodies from real material parameters."""

import logging
from typing import TYPE_CHECKING

from taichi_soft.core import signals  # noqa: F401 - first, to handle Ctrl-C during all other imports

# isort: split
from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.bodies.contact import Contact
from taichi_soft.bodies.failure import Failure
from taichi_soft.bodies.forces import force_gradient, internal_forces
from taichi_soft.bodies.plasticity import Plasticity
from taichi_soft.bodies.pose import Pose
from taichi_soft.bodies.render_mesh import RenderMesh
from taichi_soft.bodies.skin_mesh import SkinMesh
from taichi_soft.bodies.stability import StableStep, stable_step
from taichi_soft.bodies.tearing import Tearing
from taichi_soft.contact.collider import Collider
from taichi_soft.contact.shapes import (
    BoxShape,
    CapsuleShape,
    HeightFieldShape,
    MeshShape,
    PlaneShape,
    Shape,
    SphereShape,
)
from taichi_soft.control.attachments import Attachment
from taichi_soft.control.frames import Frame
from taichi_soft.control.grabs import Grab
from taichi_soft.control.joints import Joint
from taichi_soft.control.motors import Motor
from taichi_soft.core.errors import (
    DeviceError,
    DroppedEventsWarning,
    FrozenBodyWarning,
    MaterialError,
    MeshError,
    MissingExtraError,
    OptionError,
    SkippedCellsWarning,
    SlowStepWarning,
    SnapshotError,
    SolverWarning,
    StateError,
    TaichiSoftError,
    TooSoftWarning,
    UnstableStepWarning,
    VideoError,
)
from taichi_soft.core.runtime import Device, device, init
from taichi_soft.core.settings import Settings
from taichi_soft.elements.laws import LAWS, element_model
from taichi_soft.elements.laws.planes import plane_angles
from taichi_soft.elements.materials import (
    PRESETS,
    AnisotropicMaterial,
    Material,
    RigidMaterial,
    RodMaterial,
    ShellMaterial,
    SpringMaterial,
    Stiffness,
    frames_along,
    preset,
)
from taichi_soft.events import (
    Broke,
    ContactBegan,
    ContactEnded,
    Entered,
    Event,
    FellAsleep,
    Froze,
    Left,
    Listener,
    Released,
    StressExceeded,
    TearCandidates,
    Torn,
    Woke,
)
from taichi_soft.feel import Behaviour, Feel, material_from_feel
from taichi_soft.meshing import (
    MeshQuality,
    ParticleMesh,
    RodMesh,
    ShellMesh,
    TetMesh,
    beam,
    box,
    cloth,
    cloth_constants,
    cylinder,
    delaunay_mesh,
    edges_as_particles,
    extrude,
    load_mesh,
    rod,
    rope,
    save_mesh,
    sheet,
    sphere,
    surface_mesh,
    torus,
    voronoi_graph,
    voxels,
)
from taichi_soft.meshing.cage_mesh import CageMesh
from taichi_soft.meshing.rigid_mesh import RigidMesh
from taichi_soft.queries import ClosestPoint, Overlap, RayHit, RayHits, ShapeHit
from taichi_soft.world.body import Body
from taichi_soft.world.world import World

if TYPE_CHECKING:
    from engine_adapter import BudgetStatus, EngineAdapter, FixedStep, Rollback, RollbackSession, SessionError
else:
    _OF_ADAPTER = (
        "BudgetStatus",
        "EngineAdapter",
        "FixedStep",
        "Rollback",
        "RollbackSession",
        "SessionError",
    )

    def __getattr__(name):
        """Return a name of `engine_adapter`, which is only imported now because it imports this package."""
        if name == "GivenUp":
            from taichi_soft.core.renamed import warn_renamed

            warn_renamed("taichi_soft.GivenUp", "taichi_soft.BudgetStatus")
            name = "BudgetStatus"
        if name not in _OF_ADAPTER:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        import engine_adapter

        return getattr(engine_adapter, name)


__all__ = [
    "LAWS",
    "PRESETS",
    "AnisotropicMaterial",
    "Attachment",
    "Behaviour",
    "Body",
    "BoxShape",
    "Broke",
    "BudgetStatus",
    "CageMesh",
    "CapsuleShape",
    "ClosestPoint",
    "Collider",
    "Contact",
    "ContactBegan",
    "ContactEnded",
    "Device",
    "DeviceError",
    "DroppedEventsWarning",
    "EngineAdapter",
    "Entered",
    "Event",
    "Failure",
    "Feel",
    "FellAsleep",
    "FixedStep",
    "Frame",
    "Froze",
    "FrozenBodyWarning",
    "Grab",
    "HeightFieldShape",
    "Joint",
    "Left",
    "Listener",
    "Material",
    "MaterialError",
    "MeshError",
    "MeshQuality",
    "MeshShape",
    "MissingExtraError",
    "Motor",
    "OptionError",
    "Overlap",
    "ParticleMesh",
    "PlaneShape",
    "Plasticity",
    "Pose",
    "RayHit",
    "RayHits",
    "Released",
    "RenderMesh",
    "RigidMaterial",
    "RigidMesh",
    "RodMaterial",
    "RodMesh",
    "Rollback",
    "RollbackSession",
    "SessionError",
    "Settings",
    "Shape",
    "ShapeHit",
    "ShellMaterial",
    "ShellMesh",
    "SkinMesh",
    "SkippedCellsWarning",
    "SlowStepWarning",
    "SnapshotError",
    "SoftBodyAsset",
    "SolverWarning",
    "SphereShape",
    "SpringMaterial",
    "StableStep",
    "StateError",
    "Stiffness",
    "StressExceeded",
    "TaichiSoftError",
    "TearCandidates",
    "Tearing",
    "TetMesh",
    "TooSoftWarning",
    "Torn",
    "UnstableStepWarning",
    "VideoError",
    "Woke",
    "World",
    "beam",
    "box",
    "cloth",
    "cloth_constants",
    "cylinder",
    "delaunay_mesh",
    "device",
    "edges_as_particles",
    "element_model",
    "extrude",
    "force_gradient",
    "frames_along",
    "init",
    "internal_forces",
    "load_mesh",
    "material_from_feel",
    "plane_angles",
    "preset",
    "rod",
    "rope",
    "save_mesh",
    "sheet",
    "sphere",
    "stable_step",
    "surface_mesh",
    "torus",
    "voronoi_graph",
    "voxels",
]

logging.getLogger(__name__).addHandler(logging.NullHandler())  # no output unless the game configures logging
