"""One soft body of a world, as users hold it."""

from __future__ import annotations

from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies import measures
from taichi_soft.bodies.render_mesh import RenderMesh, surface_render_mesh
from taichi_soft.bodies.skin_mesh import SkinMesh, skin_meshes
from taichi_soft.bodies.stability import StableStep
from taichi_soft.control.attachments import Attachment
from taichi_soft.control.easing import Easings
from taichi_soft.control.frames import Frames
from taichi_soft.core.checks import as_array, as_positive
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
    """A handle to one body. Positions and velocities come back in the caller's vertex order."""

    @property
    def _context(self) -> WorldContext:
        return cast(WorldContext, super()._context)

    @property
    def attachments(self) -> tuple[Attachment, ...]:
        """What holds it to frames; of a piece that was cut or torn off, what it took along of these."""
        return tuple(self._context.of(Frames).holding(self))

    @recorded
    def cut(
        self,
        *,
        plane: tuple[ArrayLike, ArrayLike] | None = None,
        triangle: ArrayLike | None = None,
    ) -> tuple[Body, ...]:
        """Cut the body along the faces of tetrahedra next to a plane or a triangle, as it is now.

        A face opens where the blade passes between the centres of its two tetrahedra. Vertices keep their
        numbers, copies come behind them; mass, momentum and elastic energy stay. What falls off becomes
        bodies of the same asset, which take free slots of its pool; the largest part stays this one. In a
        part, vertices and tetrahedra are counted anew in their order: `vertex_origins` tells what they were.
        What is attached to a frame stays so in every piece, copies of it as well: see `Attachment`.
        Args:
            plane: (point (3,) [m], normal (3,)), all through the body.
            triangle: corners, (3, 3) [m]; the cut ends where it ends.
        Returns: the bodies that fell off, the largest first; none where nothing does.
        Raises: OptionError for a blade without direction or area and for a body whose asset has no
            `spare_vertices`; StateError where room or slots run out, for a body that is frozen, grabbed,
            joined to another or driven by a motor, and before `build`.
            Nothing is changed then.
        Example:
            pieces = body.cut(plane=((0, 0, 0.25), (1, 0, 0)))
            world.step(1 / 60)
            print(len(pieces), "bodies fell off")
        """
        return cast("tuple[Body, ...]", cut(self, plane, triangle))

    def render_mesh(self, *, crease: float | None = DEFAULT_CREASE) -> RenderMesh:
        """What a renderer draws of the body: its surface, with a copy of a vertex per side of a sharp edge.

        `EngineAdapter.render_mesh` or `World.read_render_mesh` fills its buffers once a frame. A cut or a
        tear makes it outdated: see `RenderMesh.is_outdated`.
        Args:
            crease: angle between neighbouring triangles at rest beyond which their edge is sharp, 0 to 180
                [degrees]; None: all is shaded as round.
        Raises: OptionError for an angle out of range; MeshError for a body without triangles, such as a rope;
            StateError for one that was removed.
        """
        return surface_render_mesh(self, crease)

    @property
    def render_meshes(self) -> tuple[SkinMesh, ...]:
        """The artist's meshes that the body carries, in their own order; none where its asset has no skin.

        They are drawn as a `render_mesh` is, and know trimesh's `visual`: texture coordinates and material.
        """
        return skin_meshes(self)

    @property
    def stable_step(self) -> StableStep:
        """Estimate of the largest stable substep."""
        return self._context.substeps.stable_step(self)

    @property
    def is_asleep(self) -> bool:
        """True while the body rests and costs nothing (see `World.sleep_speed`)."""
        simulation = self._context.fields
        return simulation is not None and simulation.is_asleep(self.index)

    @property
    def solve_residual(self) -> float | None:
        """Largest residual of the last step's implicit solves, over the load on the body; None before."""
        return self._context.built.solve_residual(self)

    @recorded
    def set_motion(self, positions: ArrayLike, velocities: ArrayLike) -> None:
        """Put the body into a given state between two steps; a frozen body is active again, and a change of
        material that is eased in is at its end.

        Args:
            positions: (n, 3) [m].
            velocities: (n, 3) [m/s], of the same moment.
        Raises: OptionError for wrong shapes or numbers that are not finite; StateError before `build`.
        """
        shape = (self.vertex_count, 3)
        x, v = as_array(positions, "positions", shape, "m"), as_array(velocities, "velocities", shape, "m/s")
        self._context.built.write_motion(self, x, v)
        self._context.of(Easings).finish(self)
        self._record.frozen_in = self._record.failure = None

    @recorded
    def set_level(self, level: int, *, release: bool = False) -> None:
        """Go on with more or fewer tetrahedra: a level of detail of the asset, 0 being the finest.

        Position, velocity, rotation and deformation pass over; centre of mass, momentum and angular momentum
        are kept to round-off. The vertices nearest to pinned ones are pinned, attachments hold those
        nearest to what they held, and grabs go on at the same point of the rest shape, with their target and
        strongest pull. Vertices and tetrahedra are others: `topology_version` counts that. `render_meshes`
        stay, and are drawn from the new mesh.
        Args:
            level: 0 or more.
            release: let go of what has no place at the new level, with an event `Released`: joints, motors,
                and attachments for which it has no vertex. Otherwise these bar the change.
        Raises: OptionError for a level that the asset does not have; StateError for a body that is frozen or
            of a material of its own, for what bars the change, and before `build`. Nothing is changed then.
        """
        released = set_level(self, level, release)
        clock = self._context.clock
        self._context.built.events.record_released(clock.steps, clock.time, self, released)

    def watch_stress(self, threshold: float | None) -> None:
        """Record a `StressExceeded` in every step in which tetrahedra come over a stress.

        One that stays over it, or has not been below 0.9 of it since, is not named again. The first call in a
        world compiles, for many seconds with an empty cache, unless `World.warm_up` has done so.
        Args:
            threshold: of `tet_stress` [Pa]; None for no longer.
        Raises: OptionError if it is not above 0; MeshError for a body without tetrahedra; StateError before
            `build`. The same for `watch_tearing`.
        """
        self._watch(StressExceeded, threshold, "threshold")

    def watch_tearing(self, tear_stress: float | None) -> None:
        """Record a `TearCandidates` in every step in which tetrahedra are pulled harder than they can bear.

        Args:
            tear_stress: of the largest principal stress, which pulls, of that of which `tet_stress` is the
                von Mises stress [Pa]. None for no longer.
        """
        self._watch(TearCandidates, tear_stress, "tear_stress")

    def _watch(self, kind: type[Event], threshold: float | None, name: str) -> None:
        log = self._context.built.events
        measures.require_tets(self)
        limit = None if threshold is None else as_positive(threshold, name, "Pa")
        log.watch(kind, self, limit)
