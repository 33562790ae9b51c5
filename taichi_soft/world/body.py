"""Public handle of one soft body of a world."""

from __future__ import annotations

from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies import measures
from taichi_soft.bodies.render_mesh import RenderMesh, surface_render_mesh
from taichi_soft.bodies.skin_mesh import SkinMesh, skin_meshes
from taichi_soft.bodies.stability import StableStep
from taichi_soft.control.attachments import Attachment
from taichi_soft.control.change import require_per_body
from taichi_soft.control.easing import Easings
from taichi_soft.control.frames import Frames
from taichi_soft.core.checks import as_array, as_flag, as_positive
from taichi_soft.core.handles import recorded
from taichi_soft.events import Event, StressExceeded, TearCandidates
from taichi_soft.fracture.cutting import cut
from taichi_soft.levels.level_change import set_level
from taichi_soft.meshing.creases import DEFAULT_CREASE
from taichi_soft.solver.context import WorldContext
from taichi_soft.world.body_control import BodyControl
from taichi_soft.world.body_measures import BodyMeasures

Floats32 = NDArray[np.float32]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Body(BodyControl, BodyMeasures):
    """Handle of one body. Positions and velocities are in the order of the mesh's vertices."""

    @property
    def _context(self) -> WorldContext:
        return cast(WorldContext, super()._context)

    @property
    def attachments(self) -> tuple[Attachment, ...]:
        """Attachments of the body to frames. A piece that was cut or torn off keeps the attachments of its
        vertices.
        """
        return tuple(self._context.of(Frames).holding(self))

    @recorded
    def cut(
        self,
        *,
        plane: tuple[ArrayLike, ArrayLike] | None = None,
        triangle: ArrayLike | None = None,
    ) -> tuple[Body, ...]:
        """Cut the body in its current shape, along the faces of tetrahedra next to a plane or a triangle.

        A face opens if the blade passes between the centres of its two tetrahedra. Vertices keep their
        indices, and copies of split vertices are appended. Mass, momentum and elastic energy are conserved.
        Detached pieces become bodies of the same asset in free slots of the asset's pool; this body keeps the
        largest piece. If pieces detach, the vertices and tetrahedra of each piece are renumbered in the same
        order; `vertex_origins` has the original indices. Attached vertices and their copies stay attached in
        every piece, see `Attachment`.
        Args:
            plane: (point (3,) [m], normal (3,)) of a cut through the whole body.
            triangle: corners, (3, 3) [m], of a cut that ends at its edges.
        Returns: the detached bodies, the largest first; empty if the body stays connected.
        Raises: OptionError for a blade without direction or area and for a body whose asset has no
            `spare_vertices`; StateError if vertices or slots run out, for a body that is frozen, grabbed,
            joined to another body or driven by a motor, and before `build`. An error changes nothing.
        Example:
            pieces = body.cut(plane=((0, 0, 0.25), (1, 0, 0)))
            world.step(1 / 60)
            print(len(pieces), "bodies fell off")
        """
        return cast("tuple[Body, ...]", cut(self, plane, triangle))

    def render_mesh(self, *, crease: float | None = DEFAULT_CREASE) -> RenderMesh:
        """Make a render mesh of the body's surface, with one vertex per side of a sharp edge.

        Call `EngineAdapter.render_mesh` or `World.read_render_mesh` once per frame to fill the buffers of the
        render mesh. A cut or a tear invalidates the render mesh, see `RenderMesh.is_outdated`.
        Args:
            crease: angle between adjacent triangles at rest above which their edge is sharp, 0 to 180
                [degrees]; None shades all edges smooth.
        Raises: OptionError for an angle out of range; MeshError for a body without triangles, such as a rope,
            and for a rigid body, which has `render_meshes`; StateError for a removed body.
        """
        return surface_render_mesh(self, crease)

    @property
    def render_meshes(self) -> tuple[SkinMesh, ...]:
        """Skins of the body (the artist's meshes), in order; empty if the body's asset has no skin.

        Draw a skin like a `render_mesh`. In addition, the attribute `visual` of a skin, from trimesh,
        contains texture coordinates and material.
        """
        return skin_meshes(self)

    @property
    def stable_step(self) -> StableStep:
        """Estimate of the largest stable substep of the body."""
        return self._context.substeps.stable_step(self)

    @property
    def is_asleep(self) -> bool:
        """True while the body sleeps and takes no time in a step (see `sleep_speed` of `World`)."""
        simulation = self._context.fields
        return simulation is not None and simulation.is_asleep(self.index)

    @property
    def solve_residual(self) -> float | None:
        """Largest residual of the implicit solves of the last step, divided by the load on the body.

        None before the first step, and with integrators other than "implicit_euler".
        """
        return self._context.built.solve_residual(self)

    @recorded
    def set_motion(self, positions: ArrayLike, velocities: ArrayLike) -> None:
        """Set the positions and velocities of the vertices between two steps.

        A frozen body becomes active again, and a gradual change of material is completed at once.
        Args:
            positions: (n, 3) [m].
            velocities: (n, 3) [m/s], at the time of the positions.
        Raises: OptionError for wrong shapes or numbers that are not finite; StateError before `build`.
        """
        shape = (self.vertex_count, 3)
        x, v = as_array(positions, "positions", shape, "m"), as_array(velocities, "velocities", shape, "m/s")
        self._context.built.write_motion(self, x, v)
        self._context.of(Easings).finish(self)
        self._record.frozen_in = self._record.failure = None

    @recorded
    def set_level(self, level: int, *, release: bool = False) -> None:
        """Change the level of detail, which determines the number of tetrahedra; level 0 is the finest.

        Position, velocity, rotation and deformation are transferred; centre of mass, momentum and angular
        momentum are conserved to round-off. Pins and attachments move to the nearest vertices. Grabs continue
        at the same point of the rest shape, with the same target and largest force. `topology_version`
        increases, because vertices and tetrahedra change. `render_meshes` stay valid and follow the new mesh.
        Args:
            level: new level, 0 or more.
            release: True releases joints, motors, and attachments that have no vertex at the new level, with
                an event `Released`. False raises an error in that case.
        Raises: OptionError for a level that the asset does not have; StateError for a body that is frozen or
            has its own material, for constraints that prevent the change, and before `build`. An error
            changes nothing.
        """
        released = set_level(self, level, release)
        clock = self._context.clock
        self._context.built.events.record_released(clock.steps, clock.time, self, released)

    @property
    def is_enabled(self) -> bool:
        """False while the body is switched off, see `set_enabled`."""
        fields = self._context.fields
        return fields is None or fields.is_enabled(self.index)

    @recorded
    def set_enabled(self, is_enabled: bool) -> None:
        """Switch the body off or on, between two steps.

        A body that is off keeps its slot, handle, shape and velocity, and costs no time in a step. It does
        not move, nothing touches it, and queries, sensors and explosions skip it. Its contacts end, and its
        joints, grabs, motors and attachments pause. `positions` and render meshes still return its shape:
        hide it in your renderer. Calls such as `teleport` and `set_velocity` change it as usual.

        A body that is switched on continues from there, awake. If other bodies have moved into it, they are
        moved apart; a collider pushes it out. What lies on the body, or is joined to it, wakes.
        Args:
            is_enabled: False switches the body off. A new body is on.
        Raises: OptionError for a value that is not a bool; StateError before `build`, and with schedule
            "flat".
        """
        simulation, flag = self._context.built, as_flag(is_enabled, "is_enabled")
        require_per_body(self._context, "bodies that are switched off")
        if flag != self.is_enabled:
            simulation.switch(self, flag)

    def watch_stress(self, threshold: float | None) -> None:
        """Record a `StressExceeded` in every step in which the stress of tetrahedra exceeds a threshold.

        A tetrahedron is reported again only after its stress has fallen below 0.9 of the threshold. The first
        call in a world compiles kernels, which takes many seconds with an empty cache, unless `World.warm_up`
        has compiled them.
        Args:
            threshold: threshold of `tet_stress` [Pa]; None stops watching.
        Raises: OptionError for a threshold that is not above 0; MeshError for a body without tetrahedra;
            StateError before `build`.
        """
        self._watch(StressExceeded, threshold, "threshold")

    def watch_tearing(self, tear_stress: float | None) -> None:
        """Record a `TearCandidates` in every step in which the tension of tetrahedra exceeds a limit.

        Args:
            tear_stress: threshold of the largest principal stress of `stresses` [Pa]; None stops watching.
        """
        self._watch(TearCandidates, tear_stress, "tear_stress")

    def _watch(self, kind: type[Event], threshold: float | None, name: str) -> None:
        log = self._context.built.events
        measures.require_tets(self)
        limit = None if threshold is None else as_positive(threshold, name, "Pa")
        log.watch(kind, self, limit)
